"""The page, and the program, can pause, step and reset a world, pick bodies, attach them and plot values."""

import math
import threading

import numpy as np
import pytest
from feed import Feed

import nuno
from nuno.viewer import Viewer


def make_world(**options):
    """Return a world with a table, a towel over it that is cloth, and a ball that is not dynamic yet."""
    world = nuno.World(device="cpu", **options)
    world.add(nuno.box((0.4, 0.4, 0.02), name="table", position=(0, 0, -0.01)))
    towel = world.add(nuno.sheet((0.2, 0.2), cells=(6, 6), name="towel", position=(0, 0, 0.02)))
    world.add(nuno.sphere(0.04, name="ball", position=(0.1, 0, 0.2)))
    world.attach(towel, nuno.Cloth.preset("towel"))
    return world


@pytest.fixture
def page():
    """A world, its viewer, and what a page of it gets and says."""
    world = make_world()
    with Viewer(world) as viewer:
        yield world, viewer, Feed(viewer)


def state(feed):
    """Return what the page's buttons show."""
    return feed.latest["controls"]["state"]


def test_a_page_steps_plays_and_resets_a_world_that_nobody_runs(page):
    """A step is one frame; play runs it in the background until pause; reset is the state at the start, to the bit."""
    world, viewer, feed = page
    start = world.find("towel").vertices
    assert state(feed) == "still"
    feed.say("step")
    feed.wait_for(lambda: world.time > 0.0)
    feed.say("step")
    feed.wait_for(lambda: feed.latest["clock"]["time"] > 1.5 / 60)
    assert world.time == pytest.approx(2 / 60) and state(feed) == "still"
    feed.say("resume")
    feed.wait_for(lambda: world.time > 0.1 and state(feed) == "running")
    feed.say("pause")
    feed.wait_for(lambda: state(feed) == "still" and not world.is_running)
    feed.say("reset")
    feed.wait_for(lambda: feed.latest["clock"]["time"] == 0.0)
    np.testing.assert_array_equal(world.find("towel").vertices, start)
    viewer.resume()
    assert world.is_running
    viewer.close()
    assert not world.is_running, "what the viewer started ends with it"


def test_a_program_that_is_paused_gets_the_same(page):
    """A run that a page pauses, lets step frame by frame and go on at another speed keeps every bit."""
    world, _, feed = page
    feed.say("pause")
    feed.wait_for(lambda: state(feed) == "paused")
    program = threading.Thread(target=world.run, args=(0.5,))
    program.start()
    feed.wait_for(lambda: world._pace.is_awaited)
    assert world.time == 0.0
    for k in range(3):
        feed.say("step")
        feed.wait_for(lambda k=k: feed.latest["clock"]["time"] > (k + 0.5) / 60)
        assert world.time == pytest.approx((k + 1) / 60)
    feed.say("speed", factor=2.0)
    feed.wait_for(lambda: feed.latest["controls"]["speed"] == 2.0)
    feed.say("resume")
    program.join()
    assert not program.is_alive()
    alone = make_world()
    alone.run(0.5)
    np.testing.assert_array_equal(world.find("towel").vertices, alone.find("towel").vertices)


def test_closing_lets_a_paused_program_go_on():
    """Nobody could let it go on after that."""
    world = make_world()
    viewer = Viewer(world)
    viewer.pause()
    viewer.speed = 1e-3
    program = threading.Thread(target=world.run, args=(0.1,))
    program.start()
    viewer.close()
    program.join()
    assert world.time == pytest.approx(0.1) and not world._pace.is_paused


def test_a_run_goes_no_faster_than_the_speed():
    """Three frames at a tenth of real time take no less than two of their spans, by whatever clock."""
    import time

    world = make_world()
    with Viewer(world) as viewer:
        viewer.speed = 0.1
        begin = time.perf_counter()
        world.run(3 / 60)
        assert time.perf_counter() - begin > 2 / 6
        viewer.speed = math.inf
        assert viewer.speed == math.inf
        world.run(0.05)
        viewer.speed = None
        assert viewer.speed is None


def test_a_background_run_is_paused_and_stepped(page):
    """It waits, makes the frames that are let through, and goes on."""
    world, viewer, feed = page
    world.start()
    feed.wait_for(lambda: state(feed) == "running")
    feed.say("pause")
    feed.wait_for(lambda: state(feed) == "paused")
    with world.lock:
        before = world.time
    viewer.step(2)
    feed.wait_for(lambda: world.time > before + 1.5 / 60)
    assert world.time == pytest.approx(before + 2 / 60)
    viewer.resume()
    feed.wait_for(lambda: world.time > before + 5 / 60)
    world.stop()


def test_a_clicked_body_is_named_attached_and_detached(page):
    """Its name and state are shown; what was detached is attached with the material that it had."""
    world, _, feed = page
    feed.say("pick", id=feed.named("world", "ball")["id"])
    feed.wait_for(lambda: feed.latest["picked"]["name"] == "ball")
    shown = feed.latest["picked"]
    assert shown["ids"] == [feed.named("world", "ball")["id"]] and not shown["dynamic"]
    assert ["place", "0.100, 0.000, 0.200 m"] in shown["rows"]
    feed.say("attach")
    feed.wait_for(lambda: feed.latest["picked"]["dynamic"])
    assert isinstance(world.find("ball").material, nuno.Rigid)
    feed.say("pick", id=feed.named("world", "towel")["id"])
    feed.wait_for(lambda: feed.latest["picked"]["name"] == "towel")
    material = world.find("towel").material
    feed.say("detach")
    feed.wait_for(lambda: not feed.latest["picked"]["dynamic"] and ["state", "static"] in feed.latest["picked"]["rows"])
    feed.say("attach")
    feed.wait_for(lambda: feed.latest["picked"]["dynamic"])
    assert world.find("towel").material is material
    world.remove("towel")
    feed.wait_for(lambda: feed.latest["picked"]["name"] is None)


def test_values_are_plotted_over_time(page):
    """A ball in free fall: the plotted heights are those of the world's clock; a reset begins the plot anew."""
    world, viewer, feed = page
    ball = world.find("ball")
    world.attach(ball)
    world.set_velocity(ball, (0, 0, 1.0))
    viewer.plot("height", lambda: ball.position[2], "m")
    seen = []
    for _ in range(4):
        world.step()
        viewer.update()
        seen.append((world.time, ball.position[2]))
    feed.wait_for(lambda: len(feed.latest.get("plots", {"plots": [{"times": []}]})["plots"][0]["times"]) >= 4)
    plot = feed.latest["plots"]["plots"][0]
    # float32 of what the world has
    np.testing.assert_allclose(np.column_stack([plot["times"], plot["values"]])[-4:], seen, rtol=1e-6)
    feed.say("pick", id=feed.named("world", "ball")["id"])
    feed.say("plot", value="speed")
    feed.wait_for(lambda: len(feed.latest["plots"]["plots"]) == 2)
    viewer.reset()
    feed.wait_for(lambda: [len(plot["times"]) for plot in feed.latest["plots"]["plots"]] == [1, 1])
    feed.say("remove plot", name="height")
    feed.wait_for(lambda: [plot["name"] for plot in feed.latest["plots"]["plots"]] == ["ball: speed"])
    viewer.plot("broken", lambda: 1 / 0)
    viewer.update()
    feed.wait_for(lambda: "broken" in feed.latest.get("notice", {"text": ""})["text"])
    assert list(viewer._plots) == ["ball: speed"], "the others go on"


def test_worlds_of_a_batch_are_chosen_from_the_page():
    """The columns that are asked for stand side by side, and a body is picked in its own world."""
    futures = make_world().imagine(4)
    with Viewer(futures, worlds=0) as viewer:
        feed = Feed(viewer)
        assert feed.latest["controls"]["worlds"] == [0] and feed.latest["controls"]["count"] == 4
        feed.say("worlds", worlds=[1, 3])
        feed.wait_for(lambda: feed.latest["controls"]["worlds"] == [1, 3])
        feed.wait_for(lambda: "world 3/towel" in feed.paths() and "world 0/towel" not in feed.paths())
        feed.say("pick", id=feed.named("world 3", "towel")["id"])
        feed.wait_for(lambda: feed.latest["picked"]["name"] == "towel")
        assert ["world", "3"] in feed.latest["picked"]["rows"]
        assert feed.latest["picked"]["ids"] == [feed.named("world 3", "towel")["id"]]
        feed.say("worlds", worlds=[9])
        feed.wait_for(lambda: "notice" in feed.latest)
        assert "from 0 to 3" in feed.latest["notice"]["text"]


def test_marks_are_switched_from_the_page(page):
    """Arrows of grips: a towel at rest on its grip pulls it down by its weight."""
    world, _, feed = page
    towel = world.detach("towel")
    towel.translate((0, 0, 0.5))
    world.attach(towel, nuno.Cloth.preset("towel"))
    corners = [0, 6, 42, 48]
    world.grip(towel, corners, to=towel.vertices[corners].mean(axis=0))
    world.run(2.0)
    feed.say("show", what="grip forces", on=True)
    feed.wait_for(lambda: "world/marks/grip forces" in feed.paths())
    start, end = feed.named("world", "marks", "grip forces")["points"].reshape(2, 3)
    weight = towel.mass * 9.81
    # 2 cm/N; the towel still swings a little after 2 s
    np.testing.assert_allclose((end - start) / 0.02, (0, 0, -weight), atol=0.1 * weight)
    feed.say("show", what="grips", on=False)
    feed.wait_for(lambda: "world/marks/grips" not in feed.paths())


def test_a_page_without_control_changes_nothing():
    """Its orders are not heard, and it shows no panel."""
    world = make_world()
    with Viewer(world, control=False) as viewer:
        feed = Feed(viewer)
        assert feed.latest["controls"]["can"] is False
        feed.say("step")
        feed.say("resume")
        world.step()
        viewer.update()
        feed.wait_for(lambda: feed.latest["clock"]["time"] > 0.0)
        assert world.time == pytest.approx(1 / 60) and not world.is_running
        with pytest.raises(nuno.BodyStateError, match="control=True"):
            viewer.reset()


@pytest.mark.parametrize(
    ("order", "message"),
    [
        ({"do": "explode"}, "explode"),
        ({"do": "speed", "factor": -1}, "speed"),
        ({"do": "speed", "factor": "fast"}, "speed"),
        ({"do": "attach"}, "no body is picked"),
        ({"do": "show", "what": "feelings", "on": True}, "feelings"),
        ({"do": "remove plot", "name": "none"}, "none"),
        ({"do": "worlds", "worlds": "all"}, "worlds"),
        ({"do": "plot", "value": "beauty"}, "no body is picked"),
    ],
)
def test_bad_orders_are_answered(page, order, message):
    """The page is told by name, and the viewer goes on."""
    _, _, feed = page
    feed.say(**order)
    feed.wait_for(lambda: message in feed.latest.get("notice", {"text": ""})["text"])


def test_bad_input(page):
    """Named, and nothing changes."""
    _, viewer, _ = page
    with pytest.raises(nuno.InvalidInputError, match="speed"):
        viewer.speed = 0.0
    with pytest.raises(nuno.InvalidInputError, match="function"):
        viewer.plot("x", 3)
    with pytest.raises(nuno.UnknownNameError):
        viewer.remove_plot("x")
    with pytest.raises(nuno.InvalidInputError, match="from 0 to 0"):
        viewer.pick("ball", world=1)
    with pytest.raises(nuno.UnknownNameError):
        viewer.pick("bell")
    with pytest.raises(nuno.InvalidInputError, match="frames"):
        viewer.step(0)
    with pytest.raises(nuno.InvalidInputError, match="World"):
        Viewer(None)
