"""Stages imagined in one batch: each finds what it would have imagined by itself, to the bit."""

from dataclasses import replace

import numpy as np
import pytest

import nuno
from nuno.camera.rectangle import ClothRectangle
from nuno.camera.table import Table
from nuno.estimate import pick_trials, together
from nuno.estimate.futures import LIFT_SECONDS, begin_picks, imagine_picks, solver_of
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation
from nuno.estimate.together import alike, imagine_together

TOP, REST_HEIGHT = 0.7, 0.0025  # [m]
HAND = np.array((0.0, 0.0, 1.1))  # [m]
CORNERS = np.array(((-0.2, -0.15), (0.2, -0.15), (0.2, 0.15), (-0.2, 0.15)))  # [m]
UV = np.array(((0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 1.0), (1.0, 1.0)))
FIRST = Discretisation(6, 6, HYPOTHESES[:2])
STAGES = (Discretisation(6, 6, HYPOTHESES[2:4], best=4), Discretisation(6, 6, HYPOTHESES[4:6], best=2))


@pytest.fixture(scope="module")
def settings():
    """What is known of a cloth of 0.4 x 0.3 m on a table."""
    corners = np.column_stack([CORNERS, np.full(4, TOP + REST_HEIGHT)])
    rectangle = ClothRectangle(corners, 0.4, 0.3, corners.mean(axis=0), 0.0, 0.0)
    return dict(
        rectangle=rectangle, grid=(3, 2), table=Table(TOP, (0.6, 0.6), (0.0, 0.0)), hand=HAND, rest_height=REST_HEIGHT,
        device="cpu",
    )  # fmt: skip


@pytest.fixture(scope="module")
def both(settings):
    """Both stages, of four candidates."""
    return imagine_together(STAGES, np.array([0, 1, 3, 5]), UV, **settings)


@pytest.mark.parametrize("stage,chosen", [(0, [0, 1, 3, 5]), (1, [0, 1, 3, 5]), (1, [1, 5])])
def test_a_part_is_what_the_stage_imagines_by_itself(both, settings, stage, chosen):
    """Positions, how long it took to rest, and the world that the whole batch goes back to, bit for bit."""
    part = both.part(STAGES[stage], np.array(chosen))
    alone = imagine_picks(candidates=UV[chosen], discretisation=STAGES[stage], **settings)
    np.testing.assert_array_equal(part.positions.numpy(), alone.positions.numpy())
    assert part.candidates == alone.candidates and part.finite.shape == alone.finite.shape and part.finite.all()
    number = len(chosen)  # the first candidate under the second hypothesis
    batch, place = part.whole(number)
    assert batch.world.time == alone.world.time
    assert batch.discretisation.hypotheses[place // batch.candidates] is STAGES[stage].hypotheses[1]
    solvers = solver_of(batch.body), solver_of(alone.body)
    for a, b in zip(*(s.velocities_apart() for s in solvers), strict=True):
        np.testing.assert_array_equal(a[place], b[number])
    np.testing.assert_array_equal(solvers[0].positions()[place], solvers[1].positions()[number])


def test_a_stage_that_takes_less_time_to_rest_shares_the_batch(settings):
    """Its cloths are those of its own last look, the other's are as ever, bit for bit."""
    short, chosen = replace(FIRST, best=4, settle_seconds=0.25), np.array([0, 5])
    both = imagine_together((short, STAGES[1]), chosen, UV, **settings)
    for stage in both.stages:
        part = both.part(stage, chosen)
        alone = imagine_picks(candidates=UV[chosen], discretisation=stage, **settings)
        np.testing.assert_array_equal(part.positions.numpy(), alone.positions.numpy())
    longer = imagine_picks(candidates=UV[chosen], discretisation=FIRST, **settings)
    assert longer.world.time > LIFT_SECONDS + 0.25 + 1e-6  # it would have gone on


def test_what_is_not_in_the_batch_is_told(both):
    """A candidate beyond it, or another stage."""
    assert both.part(STAGES[0], np.array([0, 2])) is None
    assert both.part(FIRST, np.array([0, 1])) is None


def test_stages_of_one_mesh_and_step_are_alike():
    """Another mesh, another step and a stage that looks at all candidates are left out."""
    others = (Discretisation(9, 6, HYPOTHESES, best=2), Discretisation(6, 8, HYPOTHESES, best=2), FIRST)
    assert alike((STAGES[0], *others, STAGES[1])) == STAGES
    assert alike((FIRST, *STAGES)) == (FIRST,)
    assert alike((STAGES[0], replace(STAGES[1], self_contact=False))) == STAGES[:1]


def test_an_estimate_is_the_same(monkeypatch):
    """Scores, the best future and the world that it becomes, where stages go together and where they do not.

    A stage on another mesh comes between two that go together.
    """
    s, c, pose = 5 / 13, 12 / 13, np.eye(4)  # it looks down by a sine of 5 / 13
    pose[:3] = [[0, -s, c, -0.95], [-1, 0, 0, 0], [0, -c, -s, 1.2]]
    camera = nuno.Camera(160, 120, 125.0, 125.0, 79.5, 59.5, pose)
    world = nuno.World(device="cpu")
    cloth = world.add(nuno.sheet((0.4, 0.3), cells=(6, 4), position=(0, 0, TOP + REST_HEIGHT)))
    before = world.masks(camera, cloth).numpy()
    cloth.locate((0, 0, 0.95)).rotate(1.4, "y", wrt="world")  # hangs as no pick does: no stage is sure
    after = world.masks(camera, cloth).numpy()
    stages = (FIRST, STAGES[0], Discretisation(9, 6, HYPOTHESES[2:4], best=3), STAGES[1])
    found, batches = [], []
    imagine = together.imagine_together
    monkeypatch.setattr(together, "imagine_together", lambda *a, **k: batches.append(imagine(*a, **k)) or batches[-1])
    for room in (False, True):
        monkeypatch.setattr(pick_trials, "has_room", lambda device, room=room: room)
        result = nuno.estimate_pick(
            None, None, camera=camera, table_height=TOP, table_half_extents=(0.6, 0.6), hand=HAND, before_mask=before,
            after_mask=after, candidates=(3, 2), discretisations=stages, sure=1.0, device="cpu",
            progress=False,
        )  # fmt: skip
        batch = result.futures
        guess = batch.discretisation.hypotheses[result.best_index // batch.candidates]
        world = result.adopt()
        found.append((result.scores, result.masks, guess, world.time, world.find("cloth").vertices))
    for a, b in zip(*found, strict=True):
        np.testing.assert_array_equal(a, b)
    assert [batch.stages for batch in batches] == [(FIRST,), STAGES, (stages[2],)]


def test_cloths_that_pass_through_themselves_are_as_any_whose_contact_is_ignored(settings):
    """To the bit, after the lift; and they do: the cloth folded by the lift is another where it touches itself."""

    def lifted(self_contact, ignored):
        stage = Discretisation(9, 6, HYPOTHESES[:1], self_contact=self_contact)
        futures = begin_picks(candidates=UV[:2], discretisation=stage, **settings)
        if ignored:
            futures.world.ignore_contact(futures.body, futures.body)
        futures.world.run(LIFT_SECONDS, progress=False)
        return futures.positions.numpy()

    through = lifted(False, False)
    np.testing.assert_array_equal(through, lifted(True, True))
    assert np.isfinite(through).all() and not np.array_equal(through, lifted(True, False))
