"""The plan in which all blocks of a CUDA device go through a frame together."""

import numpy as np
import pytest
import warp as wp

import nuno
from nuno.plans.group_plan import block_groups_of
from nuno.solvers.cloth_solver import ClothSolver
from nuno.tables.colliders import Colliders
from nuno.topology.cloth_topology import ClothTopology

SIDE = 70  # cells: more particles than one block takes


@wp.func_native("""
#if defined(__CUDA_ARCH__)
unsigned long long start, now;
asm volatile("mov.u64 %0, %globaltimer;" : "=l"(start));
do { asm volatile("mov.u64 %0, %globaltimer;" : "=l"(now)); } while (now - start < nanoseconds);
#endif
""")
def stay(nanoseconds: int):
    """Keep a thread running."""
    ...


@wp.kernel(enable_backward=False, module="tests.solver.keep_busy")
def keep_busy(nanoseconds: int):
    """A multiprocessor is taken for so long."""
    stay(nanoseconds)


def folded(plan="auto"):
    """A sheet whose one half lies above the other, over a table."""
    cloth = ClothTopology.sheet((SIDE, SIDE), (0.4, 0.4))
    x = cloth.rest.copy()
    over = x[:, 0] > 0
    x[:, 2] = np.where(over, 0.012, 0.004)
    x[over, 0] *= -1
    made = ClothSolver(
        cloth, nuno.Cloth(thickness=0.003), x[None], np.zeros((1, *x.shape)), device="cuda:0", substeps=40, plan=plan
    )
    made.set_colliders(Colliders.from_bodies([nuno.plane()], 1, "cuda:0"))
    return made


def test_multiprocessors_are_shared_out_among_worlds():
    """Invariant: none is taken twice, and few worlds go at once; a wait for as many as there are is no gain."""
    for worlds in range(1, 400):
        block_groups, blocks = block_groups_of(worlds, 132, 7.0)
        assert 1 <= block_groups <= worlds and blocks >= 1 and block_groups * blocks <= 132
        assert worlds > 66 or block_groups == worlds
    assert (
        block_groups_of(1, 132, 7.0) == (1, 132)
        and block_groups_of(132, 132, 7.0) == (132, 1)
        and block_groups_of(5, 1, 7.0) == (1, 1)
    )
    assert block_groups_of(140, 132, 7.0)[1] > 1  # two turns of 70 would leave half of them idle


@pytest.mark.cuda
def test_a_large_cloth_takes_all_blocks_and_repeats():
    """Promise: same input, same bits; layers in contact, lists made at several times."""
    ends = []
    for _ in range(2):
        made = folded()
        assert made.plan == "grid"
        made.run(0.0, 0.2)
        ends.append(made.local_positions())
    assert made.pair_counts.min() > 0 and made.finite().all()
    np.testing.assert_array_equal(*ends)


@pytest.mark.cuda
def test_pieces_of_a_run_change_no_bit():
    """Invariant: a launch a frame, so that frames one at a time are the run in one."""
    whole, pieces = folded(), folded()
    whole.run(0.0, 0.1)
    for k in range(6):
        pieces.run(k / 60.0, 1.0 / 60.0)
    np.testing.assert_array_equal(pieces.local_positions(), whole.local_positions())


def keep_half_busy():
    """Keep half of the multiprocessors for a second, five times as long as blocks wait for each other."""
    wp.load_module(keep_busy.module, device="cuda:0")
    wp.synchronize()
    half = wp.get_device("cuda:0").sm_count // 2
    wp.launch(keep_busy, dim=half * 256, inputs=[1_000_000_000], stream=wp.Stream("cuda:0"), device="cuda:0")


@pytest.mark.cuda
def test_where_blocks_find_no_room_each_world_has_one():
    """Promise: whatever else the device does, nothing hangs and no substep is lost; the bits are the block group's."""
    busy, undisturbed = folded(), folded()
    for made in (busy, undisturbed):
        made.run(0.0, 1.0 / 60.0)
    undisturbed.run(1.0 / 60.0, 5.0 / 60.0)
    keep_half_busy()
    busy.run(1.0 / 60.0, 5.0 / 60.0)
    assert busy._grid._blocks == 1 and undisturbed._grid._blocks > 1
    np.testing.assert_array_equal(busy.local_positions(), undisturbed.local_positions())


@pytest.mark.cuda
def test_parts_of_substeps_that_found_no_room_are_gone_through_again(monkeypatch):
    """Promise: a large cloth that meets a box has the same bits where its blocks do not fit the device all at once.

    Three times as many blocks as multiprocessors, of which each has the registers for one.
    """
    ends, cores = [], wp.get_device("cuda:0").sm_count
    for crowded in (False, True):
        if crowded:
            monkeypatch.setattr("nuno.solvers.cloth_launches.cores_of", lambda _: 3 * cores)
        world = nuno.World(device="cuda:0", substeps=40)
        world.add(nuno.plane())
        cloth = world.add(nuno.sheet((0.5, 0.5), cells=(SIDE, SIDE), position=(0.0, 0.0, 0.02)))
        box = world.add(nuno.box((0.1, 0.1, 0.04), position=(0.0, 0.0, 0.05)))
        world.attach(cloth)
        world.attach(box, nuno.Rigid(density=300.0))
        world.run(0.1)  # the box lands in the fifth frame
        assert cloth._dynamics.solver._crowded == crowded
        ends.append((cloth.vertices, box.position))
    assert len(world.contacts(box).points) > 0
    for free, found in zip(*ends, strict=True):
        np.testing.assert_array_equal(found, free)


@pytest.mark.cuda
def test_a_cloth_that_meets_a_box_has_the_same_bits_in_any_batch():
    """Promise: substeps by parts too, whether few worlds go to block groups or many to blocks."""
    world = nuno.World(device="cuda:0", substeps=30)
    world.add(nuno.plane())
    cloth = world.add(nuno.sheet((0.4, 0.4), cells=(47, 47), position=(0.0, 0.0, 0.02)))
    box = world.add(nuno.box((0.1, 0.1, 0.04), position=(0.0, 0.0, 0.05)))
    world.attach(cloth)
    world.attach(box, nuno.Rigid(density=300.0))
    many = world.imagine(140)
    for each, plan in ((world, "grid"), (many, "fused")):
        each.run(0.1)
        assert each.find(cloth.name)._dynamics.solver.plan == plan
    assert len(world.contacts(box).points) > 0
    for found in many.find(cloth.name).vertices[[0, 139]]:
        np.testing.assert_array_equal(found, cloth.vertices)
