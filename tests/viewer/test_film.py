"""A film holds what was drawn at even times, in one file."""

import logging

import numpy as np
import pytest
from feed import unpack

import nuno
from nuno.viewer import Film, Viewer
from nuno.viewer.film import STEPS
from nuno.viewer.rigid_motion import rigid_motion


def make_world():
    """Return a world in which a napkin falls onto the edge of a table, beside a ball that rolls down a path."""
    world = nuno.World(device="cpu")
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.4, 0.4, 0.02), name="table", position=(0, 0, 0.2)))
    world.attach(world.add(nuno.sheet((0.2, 0.2), cells=(6, 6), name="napkin", position=(0.2, 0, 0.25))))
    ball = world.add(nuno.sphere(0.04, name="ball", position=(0, -0.1, 0.3)))
    world.move(ball, nuno.Path([0, 1], [(0, -0.1, 0.3), (0.2, -0.1, 0.3)], [(1, 0, 0, 0), (0, 1, 0, 0)]))
    return world


def tracks_of(film):
    """Return the film's times, and its tracks by path."""
    content = unpack(film.message())[-1]
    return content["times"], {"/".join(row["path"]): row for row in content["tracks"]}


def points_of(row, key):
    """Return the points of a track at one of its keys, as the page works them out."""
    count = 3 if "poses" in row else len(row["changes"]) // (len(row["frames"]) or 1)
    whole = np.cumsum(row["changes"].reshape(-1, count), axis=0, dtype=np.uint16) if "poses" not in row else None
    steps = row["changes"].reshape(-1, 3) if whole is None else whole[key].reshape(-1, 3)
    return row["low"] + steps * np.array(row["step"])


def test_frames_come_at_even_times():
    """However the world is run: in one go, frame by frame, or in the background."""
    world = make_world()
    with Viewer(world) as viewer:
        film = viewer.record(rate=20.0)
        world.run(0.5)
        for _ in range(30):
            world.step()
        world.start(5.0)
        world.run(0.5)
        world.stop()
        film.stop()
    # a background may be a frame further than was waited for
    np.testing.assert_allclose(film.times[:31], np.arange(31) / 20.0, atol=1e-9)


def test_tracks_hold_what_was_drawn():
    """The napkin's vertices within half a step of its room, the ball's pose, and of the table one key."""
    world = make_world()
    napkin = world.find("napkin")
    with Viewer(world) as viewer:
        film = viewer.record(rate=60.0)
        seen = [napkin.vertices]
        for _ in range(30):
            world.step()
            seen.append(napkin.vertices)
        film.stop()
    times, tracks = tracks_of(film)
    np.testing.assert_allclose(times, np.arange(31) / 60.0, atol=1e-6)
    row = tracks["world/napkin"]
    assert list(row["frames"]) == list(range(31))
    half = 0.5 * np.ptp(np.concatenate(seen), axis=0) / STEPS
    for key in (0, 1, 17, 30):
        # and float32 at 0.3 m
        assert np.all(np.abs(points_of(row, key) - seen[key]) <= half + 5e-8)
    assert len(tracks["world/table"]["frames"]) == 1
    poses = tracks["world/ball"]["poses"].reshape(-1, 7)
    np.testing.assert_allclose(poses[15, :3], (0.05, -0.1, 0.3), atol=1e-7)
    np.testing.assert_allclose(poses[15, 3:], (np.cos(np.pi / 8), np.sin(np.pi / 8), 0, 0), atol=1e-7)


def test_bodies_come_and_go_in_a_film():
    """A track says from which frame to which its body was there."""
    world = make_world()
    with Viewer(world) as viewer:
        film = viewer.record(rate=60.0)
        world.run(0.1)
        world.remove("table")
        world.run(0.1)
        world.add(nuno.box((0.1, 0.1, 0.1), name="late", position=(0, 0, 1)))
        world.detach("napkin")
        world.run(0.1)
        film.stop()
    content = unpack(film.message())[-1]
    lives = [("/".join(row["path"]), row["first"], row["last"]) for row in content["tracks"]]
    assert ("world/table", 0, 7) in lives
    assert ("world/late", 13, None) in lives
    assert ("world/napkin", 0, 13) in lives and ("world/napkin", 13, None) in lives


def test_a_recording_becomes_a_film():
    """What moved rigidly has poses, what deformed has points, and the file needs no world."""
    world = make_world()
    recording = nuno.Recording.of(world, 0.5)
    film = Film.of(recording)
    times, tracks = tracks_of(film)
    np.testing.assert_allclose(times, recording.times, atol=1e-6)
    ball, napkin = tracks["recording/ball"], tracks["recording/napkin"]
    assert "poses" in ball and "poses" not in napkin and tracks["recording/floor"]["endless"]
    pose = ball["poses"].reshape(-1, 7)[20]
    placed = nuno.Coordinates(pose[:3], pose[3:]).to_world(points_of(ball, 0))
    # half of 1 / 65535 of 0.08 m, and float32
    np.testing.assert_allclose(placed, recording["ball"].vertices[20], atol=1.5e-6)
    np.testing.assert_allclose(points_of(napkin, 20), recording["napkin"].vertices[20], atol=4e-6)


def test_rigid_motion_is_told_from_deformation():
    """A turning, flying tetrahedron is rigid; one that grows by a tenth of a millimetre is not."""
    corners = np.array([(0, 0, 0), (0.1, 0, 0), (0, 0.2, 0), (0, 0, 0.3)])
    turns = [nuno.Coordinates((k, 0, 1), (np.cos(k), 0, np.sin(k), 0)) for k in np.linspace(0, 3, 7)]
    points = np.array([turn.to_world(corners) for turn in turns])
    local, poses = rigid_motion(points)
    for pose, expected in zip(poses, points, strict=True):
        # float32 at 3 m
        np.testing.assert_allclose(nuno.Coordinates(pose[:3], pose[3:]).to_world(local), expected, atol=1e-6)
    points[3, 1] += 1e-4
    assert rigid_motion(points)[1] is None
    flat = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1.0, 1, 0)])
    assert rigid_motion(np.array([flat, flat[:, [1, 0, 2]]]))[1] is not None, "a flat thing turned over"


def test_the_file_needs_nothing_else(tmp_path):
    """No address is loaded; what the scripts' licences ask for is in it; it is as small as is said."""
    world = make_world()
    with Viewer(world) as viewer, viewer.record(tmp_path / "film.html") as film:
        assert film.is_recording
        world.run(2.0)
    page = (tmp_path / "film.html").read_text()
    assert "src=" not in page.split("<!--\n")[0] and "WebSocket" in page
    assert "Copyright 2010-2021 Three.js Authors" in page and "Robin Deits" in page
    assert not film.is_recording and len(film) == 61
    # 0.86 MB of it are meshcat's page; the rest is mostly 61 frames of 49 vertices
    assert len(page) < 1.0e6
    assert "srcdoc" in film._repr_html_()


def test_a_film_that_fails_does_not_stop_the_world(monkeypatch, caplog):
    """The world goes on, the error is logged at once, and raised by ``stop``."""
    world = make_world()
    with Viewer(world) as viewer:
        film = viewer.record()
        world.run(0.1)
        monkeypatch.setattr(film, "_take", lambda: 1 / 0)
        with caplog.at_level(logging.ERROR, logger="nuno.viewer.film"):
            world.run(0.1)
        assert "ended" in caplog.text and world.time == pytest.approx(0.2)
        with pytest.raises(ZeroDivisionError):
            film.stop()
    assert world._watchers == []


def test_bad_input(tmp_path):
    """A film that goes on, another ending, an empty recording, a rate of zero."""
    world = make_world()
    with Viewer(world) as viewer:
        film = viewer.record()
        with pytest.raises(nuno.BodyStateError, match="stop it first"):
            film.save(tmp_path / "film.html")
        film.stop()
        film.stop()
        with pytest.raises(nuno.InvalidInputError, match=r"\.html"):
            film.save(tmp_path / "film.mp4")
        with pytest.raises(nuno.InvalidInputError, match="rate"):
            viewer.record(rate=0)
        with pytest.raises(nuno.InvalidInputError, match=r"\.html"):
            viewer.record(tmp_path / "film.mp4")  # before anything is recorded in vain
    with pytest.raises(nuno.InvalidInputError, match="empty"):
        Film.of(nuno.Recording(world))
    assert list(tmp_path.iterdir()) == []
