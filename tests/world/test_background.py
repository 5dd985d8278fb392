"""Running in the background: real time, changes between frames, errors that come back."""

import gc
import os
import select
import threading
import time
import weakref

import numpy as np
import pytest

import nuno
from free_fall import FreeFall, free_fall  # noqa: F401
from nuno import BodyStateError, SimulationDiverged

pytestmark = pytest.mark.usefixtures("free_fall")


def room():
    """A world with an attached towel."""
    world = nuno.World(device="cpu")
    towel = world.add(nuno.sheet((0.6, 0.4), cells=(3, 2), position=(0, 0, 1)))
    world.attach(towel)
    return world, towel


def test_real_time_and_stop():
    """Simulated time runs ahead of no scaled clock, and stands still after stop."""
    world, _ = room()
    begin = time.perf_counter()
    world.start(real_time_factor=4.0)
    assert world.is_running
    world.run(1.0)
    took = time.perf_counter() - begin
    world.stop()
    world.stop()
    stopped = world.time
    assert took > 0.2 and stopped >= 1.0 - 1e-9  # 1 s at factor 4; the first frame is due at once
    time.sleep(0.05)
    assert world.time == stopped and not world.is_running
    world.run(0.1)
    assert world.time == pytest.approx(stopped + 0.1)


def test_a_thousand_objects_come_and_go_while_it_runs():
    """Adding, moving and removing 1,000 bodies while frames are made leaves the same bodies, in one piece."""
    world, towel = room()
    first = world.bodies
    with world:
        world.start(real_time_factor=np.inf)
        begin = world.time
        added = [world.add(nuno.sphere(0.01, position=(5, 0, 0.01 * k))) for k in range(1000)]
        assert len(world.bodies) == 1001 and len({body.name for body in world.bodies}) == 1001
        for body in added[::10]:
            body.translate((0, 1, 0))
        for body in added:
            world.remove(body)
        world.run(0.1)
        assert world.time > begin
    assert world.bodies == first
    vertices = towel.vertices
    # all vertices of the stand-in fall alike: a frame seen in the middle would bend the sheet
    np.testing.assert_array_equal(vertices[:, 2], vertices[0, 2])


def test_attach_and_detach_while_it_runs():
    """Dynamics come and go between frames, from several threads."""
    world, _ = room()
    # the stand-in cannot touch others
    rags = [world.add(nuno.sheet((0.1, 0.1), (1, 1), position=(k, 0, 1), collides_with=0)) for k in range(4)]
    errors = []

    def toggle(rag):
        try:
            for _ in range(20):
                world.attach(rag)
                world.grip(rag, 0, to=(0, 0, 1)).release()
                assert len(set(rag.vertices[1:, 2])) == 1
                world.detach(rag)
        except Exception as error:
            errors.append(error)

    with world:
        world.start(real_time_factor=np.inf)
        threads = [threading.Thread(target=toggle, args=(rag,)) for rag in rags]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert errors == [] and not any(rag.is_dynamic for rag in rags)


def test_snapshots_while_it_runs():
    """Save, imagine, adopt and restore take whole frames of a running world."""
    world, towel = room()
    with world:
        world.start(real_time_factor=np.inf)
        saved, futures = world.save(), world.imagine(2)
        assert not futures.is_running
        futures.run(0.2)
        world.adopt(futures, 0)
        world.restore(saved)
        world.run(0.1)
    assert len(set(towel.vertices[:, 2])) == 1


def test_errors_of_the_background_come_back():
    """A diverged frame ends the thread; the next call raises it once, or stop where no call was made."""
    world, towel = room()
    world.start(real_time_factor=np.inf)
    world.run(0.1)
    FreeFall.diverging = True
    with pytest.raises(SimulationDiverged):
        world.run(1.0)
    assert not world.is_running and np.isfinite(towel.vertices).all()
    world.stop()
    world.start(real_time_factor=np.inf)
    while world.is_running:
        time.sleep(0.01)
    with pytest.raises(SimulationDiverged):
        world.stop()
    FreeFall.diverging = False
    world.run(0.1)


def test_starting_twice_is_refused():
    """One thread a world."""
    world, _ = room()
    with world:
        world.start()
        with pytest.raises(BodyStateError, match="runs"):
            world.start()
    world.start()
    world.stop()


def test_a_reader_can_hold_the_frame():
    """While the lock is held no frame is made, so that several reads belong together."""
    world, towel = room()
    with world:
        world.start(real_time_factor=np.inf)
        with world.lock:
            now, seen = world.time, towel.vertices
            time.sleep(0.05)
            assert world.time == now
            np.testing.assert_array_equal(towel.vertices, seen)


def test_a_dropped_world_ends_its_thread():
    """The thread does not keep a world alive."""
    world, _ = room()
    world.start()
    thread, reference = world._background._thread, weakref.ref(world)
    del world, _
    while thread.is_alive():
        gc.collect()
        time.sleep(0.02)
    assert not thread.is_alive() and reference() is None


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.parametrize("in_a_frame", [False, True])
def test_a_forked_process_is_told_that_no_frames_come(in_a_frame):
    """Its thread exists in the parent alone; so may the one that held the lock, in the midst of a frame."""
    world, _ = room()
    world.start(real_time_factor=0.01)
    reads, writes = os.pipe()
    holder = threading.Event()

    def hold():
        with world.lock:
            holder.set()
            time.sleep(1.0)

    if in_a_frame:
        threading.Thread(target=hold, daemon=True).start()
        holder.wait()
    child = os.fork()
    if child == 0:
        try:
            world.run(0.1)
        except BodyStateError as error:
            os.write(writes, str(error).encode())
        os._exit(0)
    told = select.select([reads], [], [], 10.0)[0]
    if not told:
        os.kill(child, 9)
    os.waitpid(child, 0)
    world.stop()
    assert told and b"forked" in os.read(reads, 200)
