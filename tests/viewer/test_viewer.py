"""A viewer sends what is in the world, what moved, and nothing else, to this machine only."""

import gc
import logging
import math
import socket
import threading
import time
import urllib.error
import urllib.request
import weakref

import numpy as np
import pytest
from feed import Feed

import nuno
from nuno.viewer import Film, Viewer, page_server
from nuno.viewer import following as following_module
from nuno.viewer.scene import Scene


def make_world(**options):
    """Return a world with a table, a towel over it that is cloth, and a ball that is not dynamic yet."""
    world = nuno.World(device="cpu", **options)
    world.add(nuno.box((0.4, 0.4, 0.02), name="table", position=(0, 0, -0.01)))
    towel = world.add(nuno.sheet((0.2, 0.2), cells=(6, 6), name="towel", position=(0, 0, 0.02)))
    world.add(nuno.sphere(0.04, name="ball", position=(0.1, 0, 0.2)))
    world.attach(towel, nuno.Cloth.preset("towel"))
    return world


def settled(world, viewer, feed):
    """Send the present state, and wait until the feed has all that was sent before that."""
    viewer.update()
    world.run(1e-4)
    viewer.update()
    feed.wait_for(lambda: feed.commands[-1].get("time") == world.time)


def test_all_bodies_are_sent_where_they_are():
    """Rigid bodies as their shape at a pose, a cloth as the vertices that it has."""
    world = make_world()
    with Viewer(world) as viewer:
        feed = Feed(viewer)
        assert feed.paths() == ["world/ball", "world/marks/grips", "world/table", "world/towel"]
        ball = feed.named("world", "ball")
        # float32 at 0.2 m: 2e-8
        np.testing.assert_allclose(ball["pose"], (0.1, 0, 0.2, 1, 0, 0, 0), atol=1e-7)
        np.testing.assert_allclose(
            ball["points"].reshape(-1, 3) + ball["pose"][:3], world.find("ball").vertices, atol=1e-7
        )
        towel = feed.named("world", "towel")
        assert towel["pose"] is None
        np.testing.assert_allclose(towel["points"].reshape(-1, 3), world.find("towel").vertices, atol=1e-7)


def shown(feed):
    """Return the commands that came but those that say whether the world runs, which is a matter of time."""
    return [command for command in list(feed.commands) if command["do"] != "controls"]


def test_only_what_moved_is_sent():
    """After a step: the towel's points, and of what stands still nothing."""
    world = make_world()
    with Viewer(world, frame_rate=1e-3) as viewer:  # looks only when it is told to
        feed = Feed(viewer)
        settled(world, viewer, feed)
        seen = len(shown(feed))
        world.find("ball").translate((0, 0, 0.1))
        viewer.update()
        feed.wait_for(lambda: len(shown(feed)) >= seen + 2)
        assert [command["do"] for command in shown(feed)[seen:]] == ["place", "clock"]
        assert shown(feed)[seen]["ids"] == [feed.named("world", "ball")["id"]]
        seen = len(shown(feed))
        world.step()
        viewer.update()
        feed.wait_for(lambda: len(shown(feed)) >= seen + 2)
        assert [command["do"] for command in shown(feed)[seen:]] == ["shift", "clock"]
        np.testing.assert_allclose(
            feed.named("world", "towel")["points"].reshape(-1, 3), world.find("towel").vertices, atol=1e-7
        )
        seen = len(shown(feed))
        viewer.update()
        world.find("ball").translate((0, 0, 0.1))
        viewer.update()
        feed.wait_for(lambda: len(shown(feed)) >= seen + 1)
        assert shown(feed)[seen]["do"] == "place", "where nothing happened, nothing is sent"


def test_bodies_come_and_go_while_it_looks():
    """Added, attached, detached, removed; a page that comes later gets the same."""
    world = make_world()
    towel = world.find("towel")
    with Viewer(world) as viewer:
        feed = Feed(viewer)
        world.add(nuno.soft_box((0.05, 0.05, 0.05), cells=(1, 1, 1), name="cube", position=(0, 0, 0.3)))
        feed.wait_for(lambda: "world/cube" in feed.paths())
        assert feed.named("world", "cube")["pose"] is not None
        world.attach("cube")
        feed.wait_for(lambda: "world/cube" in feed.paths() and feed.named("world", "cube")["pose"] is None)
        world.run(0.2)
        world.detach(towel)
        feed.wait_for(lambda: "world/towel" in feed.paths() and feed.named("world", "towel")["pose"] is not None)
        own = feed.named("world", "towel")
        pose = nuno.Coordinates(own["pose"][:3], own["pose"][3:])
        np.testing.assert_allclose(pose.to_world(own["points"].reshape(-1, 3)), towel.vertices, atol=1e-6)
        world.remove("ball")
        feed.wait_for(lambda: "world/ball" not in feed.paths())
        settled(world, viewer, feed)
        assert Feed(viewer).paths() == feed.paths() == ["world/cube", "world/marks/grips", "world/table", "world/towel"]


def test_a_body_is_removed_again_and_again_while_it_looks(caplog, monkeypatch):
    """What is drawn may be gone at any time; nothing is logged as an error, and the rest is still followed."""
    monkeypatch.setattr(following_module, "SHARE", 1.0)  # looks as often as it can
    world = make_world()
    with caplog.at_level(logging.WARNING), Viewer(world, frame_rate=500.0, contacts=True) as viewer:
        feed = Feed(viewer)
        world.start(math.inf)
        for k in range(40):
            ball = world.remove("ball")
            cube = world.add(nuno.soft_box((0.05, 0.05, 0.05), cells=(1, 1, 1), name="cube", position=(0, 0, 0.3)))
            world.attach(cube)
            world.add(ball)
            (world.attach if k % 2 else world.find)(ball)
            time.sleep(0.005)
            world.remove(cube)
        world.stop()
        settled(world, viewer, feed)
        assert feed.paths() == ["world/ball", "world/marks/contacts", "world/marks/grips", "world/table", "world/towel"]
    assert not caplog.records


def test_viewing_changes_no_bit(monkeypatch):
    """A world that is looked at, with contacts, and filmed, moves as one that is not."""
    monkeypatch.setattr(following_module, "SHARE", 1.0)  # looks as often as it can
    monkeypatch.setattr(following_module, "POLL", 0.0)  # though there is no page
    runs = []
    for looked_at in (False, True):
        world = make_world()
        world.grip("towel", [0], to=nuno.Path([0, 0.3], [(-0.1, -0.1, 0.02), (0, 0, 0.1)]))
        if looked_at:
            with Viewer(world, frame_rate=200.0, contacts=True) as viewer, viewer.record():
                world.run(0.51)
        else:
            world.run(0.51)
        runs.append(world.find("towel").vertices)
    assert np.array_equal(*runs)


@pytest.mark.parametrize("real_time_factor", [1.0, math.inf])
def test_a_world_in_the_background_is_followed(real_time_factor):
    """Also one that makes frames as fast as it can, without pause; a page may hear twice of one time, never go back."""
    world = make_world()
    with Viewer(world) as viewer:
        feed = Feed(viewer)
        world.start(real_time_factor)
        clocks = lambda: [command["time"] for command in feed.commands if command["do"] == "clock"]  # noqa: E731
        feed.wait_for(lambda: len(set(clocks())) > 5)
        world.stop()
        assert np.all(np.diff(clocks()) >= 0.0)


def test_a_stepped_world_is_followed():
    """One long run, and a loop of steps without pause, both show pictures in between."""
    world = make_world()
    with Viewer(world) as viewer:
        feed = Feed(viewer)
        between = set()
        while len(between) < 5:
            begin = world.time
            world.run(20.0)
            clocks = [command["time"] for command in list(feed.commands) if command["do"] == "clock"]
            between |= {time for time in clocks if begin < time < world.time}
        seen = len(feed.commands)
        while sum(command["do"] == "clock" for command in feed.commands[seen:]) < 5:
            world.step()


def test_it_looks_rarely_while_nobody_does(monkeypatch):
    """Without a page a world is looked at only now and then; a page that comes is shown all of it, and follows."""
    monkeypatch.setattr(following_module, "POLL", 1e6)
    looks = []
    look = Scene.look
    monkeypatch.setattr(Scene, "look", lambda own, sparing=False: (looks.append(sparing), look(own, sparing))[1])
    world = nuno.World(device="cpu")
    ball = world.add(nuno.sphere(0.1, name="ball"))
    with Viewer(world, frame_rate=500.0) as viewer:
        time.sleep(0.2)  # a hundred looks
        assert len(looks) <= 2  # when it was made, and the thread's first
        ball.locate((0, 0, 1))
        feed = Feed(viewer)
        feed.wait_for(lambda: feed.named("world", "ball")["pose"][2] == 1.0)
        assert len(looks) > 2


def test_it_takes_a_share_of_the_time_only(monkeypatch):
    """Looks that take long are done more rarely than they were asked for."""
    busy = 0.02

    def look(own, sparing=False):
        looks.append(time.perf_counter())
        end = time.thread_time() + busy
        while time.thread_time() < end:
            pass

    looks = []
    monkeypatch.setattr(following_module, "SHARE", 0.1)
    with Viewer(nuno.World(device="cpu"), frame_rate=1000.0) as viewer:
        Feed(viewer)
        monkeypatch.setattr(Scene, "look", look)
        while len(looks) < 16:
            time.sleep(0.01)
    # what is measured is an average of the last five or so, which have to be taken in first: 5 of them in a hurry,
    # then one in busy / SHARE = 0.2 s, or more where others take the machine; in a hurry it would be busy
    assert np.median(np.diff(looks)[8:]) > 5 * busy


def test_modes_are_what_draw_draws():
    """The points that are sent are those of ``nuno.draw``, while the body deforms."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane())
    cube = world.add(nuno.soft_sphere(0.1, 0.06, name="ball", position=(0, 0, 0.12)))
    world.attach(cube, nuno.Soft(youngs_modulus=2e4))
    for mode, options in (
        ("surface", {}), ("wireframe", {}), ("tetrahedra", {"explode": 1.5}),
        ("tetrahedra", {"slice_at": ((0, 0, 0), (1, 0, 0))}),
    ):  # fmt: skip
        with Viewer(world) as viewer:
            viewer.draw(cube, mode, **options)
            feed = Feed(viewer)
            world.run(0.1)
            settled(world, viewer, feed)
            sent, drawn = feed.named("world", "ball"), nuno.draw(cube, mode, **options)
            # float32 at 0.2 m
            np.testing.assert_allclose(sent["points"].reshape(-1, 3), drawn.vertices, atol=1e-7)
            assert np.array_equal(sent["triangles"].reshape(-1, 3), drawn.triangles)


def test_a_look_that_fails_lets_go_of_the_world(monkeypatch, caplog):
    """The viewer's thread logs what went wrong and goes on looking; nobody waits for a lock that it keeps."""
    world = make_world()
    failed = threading.Event()
    look = Scene.look

    def fails_once(scene, sparing=False):
        if sparing and not failed.is_set():
            failed.set()
            raise RuntimeError("a body that cannot be drawn")
        look(scene, sparing)

    with caplog.at_level(logging.ERROR), Viewer(world, frame_rate=200.0) as viewer:
        feed = Feed(viewer)
        monkeypatch.setattr(Scene, "look", fails_once)
        failed.wait()
        with world.lock:  # the viewer's thread has let go of it
            pass
        world.step()
        feed.wait_for(lambda: feed.commands[-1].get("time") == world.time)
    assert "could not draw" in caplog.text


def test_grips_contacts_and_cameras_are_marked():
    """Held points are where the vertices are, arrows as long as the forces, a camera goes along with its body."""
    world = make_world()
    towel, ball = world.find("towel"), world.find("ball")
    world.grip(towel, [0, 6], to=(0, -0.1, 0.05))
    pose = np.eye(4)
    pose[:3, 3] = (0.1, 0, 0.3)
    camera = nuno.Camera(640, 480, 500, 500, 320, 240, pose)
    with Viewer(world, contacts=True, force_scale=0.5) as viewer:
        viewer.add_camera("eye", camera, on=ball)
        feed = Feed(viewer)
        world.run(0.3)
        ball.translate((0, 0.5, 0))
        settled(world, viewer, feed)
        grips = feed.named("world", "marks", "grips")["points"].reshape(-1, 3)
        np.testing.assert_allclose(grips, towel.vertices[[0, 6]], atol=1e-7)
        found = world.contacts(towel)

        def drawn():
            return feed.named("world", "marks", "contacts")["points"].reshape(-1, 2, 3)

        # the viewer's own thread may have told of this time before, sparing the contacts; ``update`` tells all
        feed.wait_for(lambda: drawn().shape[0] == len(found) and np.allclose(drawn()[:, 0], found.points, atol=1e-7))
        arrows = drawn()
        assert len(found) > 5
        np.testing.assert_allclose(arrows[:, 0], found.points, atol=1e-7)
        np.testing.assert_allclose(arrows[:, 1] - arrows[:, 0], 0.5 * found.forces, atol=1e-7)
        np.testing.assert_allclose(feed.named("world", "cameras", "eye")["pose"][:3], (0.1, 0.5, 0.3), atol=1e-7)
        viewer.remove_camera("eye")
        feed.wait_for(lambda: "world/cameras/eye" not in feed.paths())


def test_worlds_of_a_batch_stand_side_by_side():
    """Each where its vertices are, moved by its place; or one alone."""
    world = make_world()
    futures = world.imagine(3)
    futures.push("towel", np.array([(0.0, 0, 0), (0.5, 0, 0), (0, 0, 0.5)]))
    futures.run(0.1)
    with Viewer(futures, spacing=(1.0, 2.0)) as viewer:
        feed = Feed(viewer)
        for k, offset in enumerate([(0, 0, 0), (0, 2, 0), (-1, 0, 0)]):
            points = feed.named(f"world {k}", "towel")["points"].reshape(-1, 3)
            np.testing.assert_allclose(points, futures.find("towel").vertices[k] + offset, atol=3e-7)
    with Viewer(futures, worlds=2) as viewer:
        feed = Feed(viewer)
        points = feed.named("world 2", "towel")["points"].reshape(-1, 3)
        np.testing.assert_allclose(points, futures.find("towel").vertices[2], atol=1e-7)
        assert not any(path.startswith("world 1") for path in feed.paths())
    with pytest.raises(nuno.InvalidInputError, match="from 0 to 2"):
        Viewer(futures, worlds=[0, 3])


@pytest.mark.parametrize(
    ("name", "elbow"), [("talos", "arm_left_4_joint"), pytest.param("g1", "left_elbow_joint", marks=pytest.mark.long)]
)
def test_robots_are_drawn_by_their_visual_meshes(name, elbow):
    """Each visual mesh is where Pinocchio has it, also of a robot that enters while it looks, and moves."""
    world = nuno.World(device="cpu")
    with Viewer(world) as viewer:
        robot = nuno.Humanoid(name)
        links = robot.enter(world)
        feed = Feed(viewer)
        robot.angle_vector({elbow: robot.angle_vector()[robot.joint_index(elbow)] + 0.3})
        links.follow(0.1)
        world.run(0.1)
        settled(world, viewer, feed)
        placements = robot.update().oMi
        shapes = robot.geometry.shapes("visual")
        sent = {thing["path"][2]: thing for thing in feed.things.values() if thing["path"][1] == name}
        assert len(sent) == len(shapes)
        for shape in shapes:
            joint = placements[shape.joint]
            expected = joint.translation + joint.rotation @ shape.position
            # float32 at 2 m, and quaternions of float32 led over 0.1 s
            np.testing.assert_allclose(sent[shape.link]["pose"][:3], expected, atol=2e-6)
        links.leave()
        feed.wait_for(lambda: not any(name in path for path in feed.paths()))


def test_it_listens_on_this_machine_only():
    """Bound to the loopback address; and a request by another name is refused."""
    with Viewer(nuno.World()) as viewer:
        addresses = [sock.getsockname()[0] for sock in viewer._server._sockets]
        assert addresses == ["127.0.0.1"]
        assert b"page.js" not in urllib.request.urlopen(viewer.url).read()[:100]
        asked = urllib.request.Request(viewer.url, headers={"Host": "example.org"})
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(asked)
        assert refused.value.code == 403


def test_two_viewers_at_once():
    """Each at its own port; one of them closed, the other goes on."""
    world = make_world()
    with Viewer(world) as first, Viewer(world, mode="wireframe") as second:
        assert first.url != second.url
        feeds = [Feed(viewer) for viewer in (first, second)]
        assert [len(feed.named("world", "towel")["triangles"]) > 0 for feed in feeds] == [True, False]
        first.close()
        feeds[0].wait_for(lambda: feeds[0].is_closed)
        world.run(0.2)
        settled(world, second, feeds[1])
        points = feeds[1].named("world", "towel")["points"].reshape(-1, 3)
        np.testing.assert_allclose(points, world.find("towel").vertices, atol=1e-7)


def test_a_port_that_is_taken_is_said():
    """By name; and without one, the next that is free is taken."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(nuno.errors.ViewerError, match=f"{port} of 127.0.0.1 is taken"):
            Viewer(nuno.World(), port=port)
    with pytest.raises(nuno.errors.ViewerError, match="not to be had"):
        Viewer(nuno.World(), host="203.0.113.1")  # of documentation: no machine's own


def test_a_closed_viewer_says_so():
    """All that needs the page raises; closing again does nothing; the world goes on."""
    world = make_world()
    viewer = Viewer(world)
    film = viewer.record()
    viewer.close()
    viewer.close()
    for action in (
        viewer.show, viewer.update, viewer.live, lambda: viewer.draw("towel"), lambda: viewer.play(film),
        lambda: viewer.look_from((1, 0, 0), (0, 0, 0)),
    ):  # fmt: skip
        with pytest.raises(nuno.errors.ViewerError, match="is closed"):
            action()
    world.run(0.1)
    film.stop()
    assert film.duration == pytest.approx(0.1)
    assert "closed" in repr(viewer) and "iframe" not in viewer._repr_html_()


def test_a_port_is_found_where_the_first_ones_are_taken(monkeypatch):
    """Programs that leave many viewers open keep nobody from opening one more."""
    with Viewer(make_world()) as first:
        monkeypatch.setattr(page_server, "FIRST_PORT", int(first.url.rstrip("/").rpartition(":")[2]))
        monkeypatch.setattr(page_server, "PORTS", 1)
        with Viewer(make_world()) as second:
            assert second.url != first.url
            assert Feed(second).paths()


def test_a_viewer_that_is_dropped_ends():
    """With its thread and its server, once nobody holds the viewer or the world."""
    world = make_world()
    viewer = Viewer(world)
    watched, thread = weakref.ref(viewer), viewer._thread
    del viewer, world
    while watched() is not None:
        gc.collect()
        time.sleep(0.05)
    thread.join()
    assert not any(t.name == "nuno-viewer" for t in threading.enumerate())


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda world: Viewer(world, mode="solid"), 'mode must be "surface", "wireframe" or "tetrahedra"'),
        (lambda world: Viewer(world, frame_rate=0.0), "frame_rate"),
        (lambda world: Viewer(world, worlds=1), "from 0 to 0"),
    ],
)
def test_bad_input_leaves_nothing_behind(call, message):
    """No thread, no watcher."""
    world = make_world()
    with pytest.raises(nuno.InvalidInputError, match=message):
        call(world)
    assert world._watchers == []


def test_bad_input_to_its_methods():
    """Each says what is valid, and nothing changes."""
    world = make_world()
    with Viewer(world) as viewer:
        for call, message in (
            (lambda: viewer.draw("towel", "solid"), "mode must be"),
            (lambda: viewer.draw("towel", "tetrahedra"), "only soft bodies"),
            (lambda: viewer.draw("towel", opacity=0.0), "opacity"),
            (lambda: viewer.look_from((1, 1, 1), (1, 1, 1)), "different points"),
            (lambda: viewer.play("film.html"), "Recording or a Film"),
            (lambda: viewer.add_camera("eye", "camera"), "a Camera"),
        ):
            with pytest.raises(nuno.InvalidInputError, match=message):
                call()
        with pytest.raises(nuno.UnknownNameError, match="towel"):
            viewer.draw("tablecloth")
        with pytest.raises(nuno.BodyStateError, match="stop it first"):
            viewer.play(viewer.record())
        assert isinstance(viewer.still(), Film)
