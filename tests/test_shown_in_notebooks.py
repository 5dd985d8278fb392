"""What notebooks show of worlds, bodies, recordings and results."""

import cv2
import numpy as np
import pytest

import nuno
from html_page import HOSTILE, Page
from nuno.search.minimise import Minimum
from nuno.tasks.look_at_camera import look_at_camera

LARGEST = 4000  # characters of what has no picture


def shown(thing):
    """Return the page of a thing, which is small, closes its tags, and has neither scripts nor handlers of events."""
    text = thing._repr_html_()
    assert len(text) < LARGEST
    page = Page(text)
    assert page.open == [] and not {"script", "iframe", "style"} & {tag for tag, _ in page.tags}
    assert not any(attributes for _, attributes in page.tags), "no attributes, so no handlers"
    return page


@pytest.fixture
def world():
    """A table, and a soft cube of an odd name that moves."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((1, 1, 0.02), name="table", position=(0, 0, 0.7)))
    world.attach(world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(1, 1, 1), name=HOSTILE, position=(0, 0, 0.9))))
    return world


def test_a_world_lists_its_bodies(world):
    """Name, shape, place and dynamics of each."""
    page = shown(world)
    assert "World at t = 0.000 s" in page.text
    for piece in ("table", "box", "(0.000, 0.000, 0.700) m", "static", HOSTILE, "Soft"):
        assert piece in page.text
    assert "World at t = 0.000 s, 3 worlds" in shown(world.imagine(3)).text
    assert shown(nuno.World(device="cpu")).text[0].strip() == ""


def test_a_world_of_many_bodies_is_small():
    """The rest is counted."""
    world = nuno.World(device="cpu")
    for _ in range(300):
        world.add(nuno.sphere(0.01))
    assert "and 280 more" in shown(world).text


def test_a_body_says_what_it_is(world):
    """With its mass where it is dynamic: 1000 kg/m3 by default, in 1 l."""
    page = shown(world.find(HOSTILE))
    assert f"Body {HOSTILE!r}" in page.text and "dynamic: Soft" in page.text
    mass = float(np.squeeze(world.find(HOSTILE).mass))
    assert f"{mass:.4g} kg" in page.text
    assert "static" in shown(world.find("table")).text
    assert "in 2 worlds" in shown(world.imagine(2).find(HOSTILE)).text


def test_a_recording_says_what_moves(world):
    """And when."""
    recording = nuno.Recording.of(world, 2 / 60)
    page = shown(recording)
    assert "Recording of 3 frames, t = 0.000 to 0.033 s" in page.text
    assert [piece for piece in page.text if piece in ("yes", "no")] == ["no", "yes"]
    shown(nuno.Recording(world))


def test_a_picture_is_a_png(world):
    """As large as it is, and of a batch all worlds."""
    camera = look_at_camera((1.0, -1.0, 1.2), (0, 0, 0.8), 80, 60, 80.0)
    picture = nuno.take_picture(world, camera)
    png = cv2.imdecode(np.frombuffer(picture._repr_png_(), np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(png[..., ::-1], picture.color.numpy())
    png = nuno.take_picture(world.imagine(4), camera)._repr_png_()
    assert cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR).shape == (120, 160, 3)


def test_a_sweep_is_a_table():
    """Parameters and single values by trial; a failed one says why."""
    trials = [nuno.Trial(0, {"height": np.array(0.25), "path": np.zeros(3)}, None), nuno.Trial(1, {}, HOSTILE), None]
    result = nuno.SweepResult({"friction": np.array([0.1, 0.2, 0.3])}, trials)
    page = shown(result)
    assert "SweepResult: 2 of 3 trials, 1 failed" in page.text
    cells = [piece for piece in page.text if piece.strip()]
    assert cells[1:4] == ["trial", "friction", "height"] and cells[4:] == ["0", "0.1", "0.25", "1", "0.2", HOSTILE]
    shown(nuno.SweepResult({}, []))


def test_minima_and_lifts_are_tables():
    """With what they found."""
    minimum = Minimum({HOSTILE: 0.5}, 1.25, {}, (), {HOSTILE: np.zeros(7)}, np.zeros(7), "it was enough", ())
    page = shown(minimum)
    assert "Minimum: 1.25 after 7 trials" in page.text and HOSTILE in page.text and "it was enough" in page.text
    lift = nuno.LiftResult(
        np.array([1e-3, 2e-3]), np.array([np.nan, 2.0]), np.array([False, True]), np.zeros(2), 0.2, 0.5, 9.81
    )
    page = shown(lift)
    assert "dropped" in page.text and "2.000" in page.text and any("1.962 N" in piece for piece in page.text)


def test_a_carried_mat_shows_the_steadiest():
    """The first five of those that held, the best one first."""
    trials = tuple(nuno.CarryTrial(0.3, 0.01 * k, 0.0, None if k == 0 else 0.1 * k, None, "") for k in range(9))
    result = nuno.CarryResult(trials, None, None, np.zeros(9, int), None, "cpu", {})
    page = shown(result)
    assert "CarryResult: 9 trials, the mat fell in 1" in page.text
    assert [piece for piece in page.text if piece.endswith("00.0")] == ["100.0", "200.0", "300.0", "400.0", "500.0"]
    fallen = nuno.CarryResult(trials[:1], None, None, np.zeros(1, int), None, "cpu", {})
    assert "the mat fell in 1" in shown(fallen).text[-2]
