"""What a browser shows is where Nuno's own renderer sees it."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from browser import Browser, needs_chromium, save_picture
from viewer_page import viewer_page

import nuno
from nuno.viewer import Film, Viewer

WIDTH, HEIGHT = 800, 600
EYE, TARGET = np.array((1.7, -1.1, 1.5)), np.array((0.35, 0.0, 0.75))


@pytest.fixture(scope="module")
def browser():
    """One browser for all tests."""
    with Browser(WIDTH, HEIGHT) as opened:
        yield opened


@pytest.fixture(scope="module")
def lifted(tmp_path_factory):
    """A world in which Talos stands behind a table from which a towel was lifted, its film, and the film's file."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((0.7, 1.2, 0.02), name="table", color="#a07040", position=(0.75, 0, 0.71)))
    towel = world.add(nuno.sheet((0.3, 0.4), cells=(12, 16), name="towel", color="#2060e0", position=(0.7, 0, 0.725)))
    world.attach(towel, nuno.Cloth.preset("towel"))
    nuno.Humanoid("talos").enter(world)
    start = towel.vertices
    edge = towel.at([0, 0, 0], [0, 0.5, 1])
    way = np.array([(0.55, 0, 0.725), (0.6, 0, 0.95)])
    world.grip(towel, edge, to=nuno.Path([0.1, 0.8], way, interpolation="minimum_jerk"))
    path = tmp_path_factory.mktemp("film") / "lift.html"
    with Viewer(world, grips=False) as viewer:
        viewer.look_from(EYE, TARGET)
        with viewer.record(path) as film:
            world.run(1.0)
    assert film.duration == pytest.approx(1.0)
    return world, start, path


def camera_of(eye, target, field=45.0):
    """Return the page's camera, in OpenCV's axes: z ahead, y down."""
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, (0, 0, 1))
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(ahead, right), ahead])
    pose[:3, 3] = eye
    focal = 0.5 * HEIGHT / np.tan(0.5 * np.radians(field))
    return nuno.Camera(WIDTH, HEIGHT, focal, focal, 0.5 * WIDTH - 0.5, 0.5 * HEIGHT - 0.5, pose)


def blue(picture):
    """Return where the towel's colour is seen, bright or in shadow, above the slider, which is blue as well."""
    r, g, b = (picture[..., k].astype(int) for k in range(3))
    seen = (b > 1.5 * r) & (b > 1.3 * g) & (b > 60)
    seen[-60:] = False
    return seen


def overlap(a, b):
    """Return the intersection over the union of two masks."""
    return (a & b).sum() / (a | b).sum()


def mask_of(world, camera, *bodies):
    """Return where Nuno's own renderer sees bodies."""
    ids = world.ids(camera).numpy()
    return np.isin(ids, [world.bodies.index(body) for body in bodies])


@needs_chromium
def test_a_film_shows_the_cloth_as_it_deformed(browser, lifted, tmp_path):
    """At two times of the slider: the towel's pixels are those of Nuno's renderer, flat at first, lifted at last."""
    world, start, path = lifted
    camera = camera_of(EYE, TARGET)
    towel = world.find("towel")
    flat = nuno.World(device="cpu")
    flat.add(nuno.box((0.7, 1.2, 0.02), position=(0.75, 0, 0.71)))
    shown = flat.add(nuno.cloth_mesh(start, towel.faces))
    seen = {0.0: mask_of(flat, camera, shown), 1.0: mask_of(world, camera, towel)}
    browser.open(path.as_uri())
    for at, expected in seen.items():
        browser.evaluate(f"nuno.seek({at})")
        picture = browser.picture()
        save_picture(picture, tmp_path / f"film_{at:.0f}.png")
        assert expected.sum() > 4000
        # a pixel round the edge, of some 500 about 14,000, belongs to either
        assert overlap(blue(picture), expected) > 0.96
    assert overlap(seen[0.0], seen[1.0]) < 0.7, "the two times are told apart"


@needs_chromium
def test_a_film_between_two_frames(browser, lifted):
    """Half-way between two frames, the page has the towel half-way, and the slider says when that is."""
    path = lifted[2]
    browser.open(path.as_uri())
    find = "[...nuno.things.values()].find((thing) => thing.path[1] === 'towel')"
    heights = []
    for at in (15 / 30, 15.5 / 30, 16 / 30):
        browser.evaluate(f"nuno.seek({at})")
        heights.append(browser.evaluate(f"Array.from({find}.surface.attributes.position.array)"))
    before, between, after = np.array(heights)
    # the page works in float32 of values below 1
    np.testing.assert_allclose(between, 0.5 * (before + after), atol=2e-7)
    assert np.abs(after - before).max() > 1e-3
    assert browser.evaluate("Number(document.getElementById('time').value)") == pytest.approx(16 / 30, abs=1e-6)
    assert browser.evaluate("document.getElementById('clock').textContent") == "t = 0.53 s"
    browser.evaluate("document.getElementById('play').click()")
    browser.wait_for("Number(document.getElementById('time').value) > 0.9")


@needs_chromium
def test_a_film_shows_the_robot(browser, lifted, tmp_path):
    """Where Nuno's renderer sees its links is the robot, white, black and orange, and nowhere else."""
    world, _, path = lifted
    links = [body for body in world.bodies if body.name.startswith("talos/")]
    expected = mask_of(world, camera_of(EYE, TARGET), *links)
    browser.open(path.as_uri())
    browser.evaluate("nuno.seek(1.0)")
    picture = browser.picture()
    save_picture(picture, tmp_path / "robot.png")
    hide = "[...nuno.things.values()].forEach((t) => { if (t.path[1] === 'talos') t.object.visible = false; })"
    browser.evaluate(f"{hide}; nuno.viewer.set_dirty()")
    without = browser.picture()
    robot = np.abs(picture.astype(int) - without).max(axis=2) > 24
    robot[:40] = robot[-60:] = False
    expected[:40] = expected[-60:] = False  # the page's own controls
    # visual meshes lie in the convex hulls that are rendered, which are wider between the fingers and round the feet;
    # besides them only shadows on the table change
    grown = cv2.dilate(expected.astype(np.uint8), np.ones((5, 5))) > 0
    table = mask_of(world, camera_of(EYE, TARGET), world.find("table"), world.find("towel"))
    assert expected.sum() > 20000
    assert (robot & expected).sum() > 0.85 * expected.sum()
    assert (robot & ~grown & ~table).sum() < 0.01 * expected.sum()
    colours = picture[robot & expected].astype(int)
    grey = np.ptp(colours, axis=1) < 40
    assert (grey & (colours.min(axis=1) > 150)).mean() > 0.2, "the trunk is white"
    assert (grey & (colours.max(axis=1) < 110)).mean() > 0.1, "the upper arms are black"


@needs_chromium
def test_a_film_asks_for_nothing_and_complains_of_nothing(browser, lifted):
    """The page loads no address but its own, and its scripts raise nothing."""
    browser.requests.clear()
    browser.complaints.clear()
    browser.open(lifted[2].as_uri())
    browser.evaluate("nuno.seek(0.5)")
    browser.picture()
    browser.call("Page.navigate", url="about:blank")
    browser.open(lifted[2].as_uri() + "#t=0.7")
    assert browser.evaluate("document.getElementById('clock').textContent") == "t = 0.70 s"
    browser.evaluate("location.hash = 't=0.3'")  # as when another link into the film is followed
    browser.wait_for("document.getElementById('clock').textContent == 't = 0.30 s'")
    assert [url for url in browser.requests if not url.startswith(("file:", "data:", "blob:"))] == []
    assert browser.complaints == []


@needs_chromium
def test_the_live_page_follows_in_all_modes(browser, tmp_path):
    """A soft ball as surface, wireframe and tetrahedra: as much of the picture is covered as there should be."""
    world = nuno.World(device="cpu")
    ball = world.add(nuno.soft_sphere(0.1, 0.05, name="ball", color="#2060e0", position=(0, 0, 0.2)))
    world.attach(ball)
    world.push(ball, (0, 0, 9.81 * ball.material.density * 4 / 3 * np.pi * 0.1**3))
    eye, target = np.array((0.6, -0.4, 0.4)), np.array((0.0, 0, 0.2))
    browser.complaints.clear()
    covered = {}
    with Viewer(world) as viewer:
        viewer.look_from(eye, target)
        browser.open(viewer.url)
        for mode in ("surface", "wireframe", "tetrahedra"):
            seen = browser.evaluate("nuno.messages")
            viewer.draw(ball, mode, explode=1.6)
            world.run(0.1)
            browser.wait_for(f"nuno.messages > {seen} && [...nuno.things.values()].some((t) => t.path[1] === 'ball')")
            browser.wait_for(f"document.getElementById('clock').textContent === 't = {world.time:.2f} s'")
            picture = browser.picture()
            save_picture(picture, tmp_path / f"{mode}.png")
            covered[mode] = blue(picture)
        expected = mask_of(world, camera_of(eye, target), ball)
        # the renderer draws the embedded sphere, which the surface is
        assert overlap(covered["surface"], expected) > 0.95
        inside = covered["wireframe"] & expected
        assert 0.05 < inside.sum() / expected.sum() < 0.7, "lines, with the background between them"
        rows = [np.ptp(np.flatnonzero(covered[mode].any(axis=1))) for mode in ("surface", "tetrahedra")]
        # middles of tetrahedra move 1.6 times as far out, their corners less; the lattice is larger than the ball
        assert rows[1] > 1.3 * rows[0]
    browser.wait_for("!document.getElementById('notice').hidden")
    errors = [c for c in browser.complaints if "WebSocket" not in str(c)]
    assert errors == []


@needs_chromium
def test_a_recording_is_played_in_the_live_page(browser):
    """In place of the world, which comes back afterwards."""
    world = nuno.World(device="cpu")
    ball = world.add(nuno.sphere(0.1, name="ball", color="crimson", position=(0, 0, 0.5)))
    world.attach(ball)
    recording = nuno.Recording.of(world, 0.3)
    height = "[...nuno.things.values()].find((t) => t.path[1] === 'ball').object.position.z"
    with Viewer(world) as viewer:
        browser.open(viewer.url)
        film = viewer.play(recording)
        browser.wait_for("!document.getElementById('bar').hidden")
        for frame in (0, 9, 18):
            browser.evaluate(f"nuno.seek({recording.times[frame]})")
            expected = recording["ball"].vertices[frame, :, 2].mean()
            # float32 of time at which the ball moves at 3 m/s
            assert browser.evaluate(height) == pytest.approx(expected, abs=1e-6)
        viewer.live()
        browser.wait_for("document.getElementById('bar').hidden && nuno.things.size > 0")
        assert browser.evaluate(height) == pytest.approx(ball.position[2], abs=1e-6)
        assert isinstance(film, Film)


@needs_chromium
def test_the_page_controls_the_world(browser, tmp_path):
    """Buttons step and reset; a click picks what is seen there, another button attaches it; its colours are seen."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((0.6, 0.6, 0.04), name="table", position=(0, 0, -0.02)))
    towel = world.add(nuno.sheet((0.4, 0.4), cells=(8, 8), name="towel", position=(0, 0, 0.01)))
    eye, target = np.array((0.5, -0.5, 0.7)), np.array((0.0, 0, 0))
    browser.complaints.clear()
    with Viewer(world) as viewer:
        viewer.look_from(eye, target)
        browser.open(viewer.url)
        # a gray towel on a gray table: its border is a dark line, of one pixel in a ring of five
        picture = browser.picture()
        save_picture(picture, tmp_path / "gray.png")
        ids = world.ids(camera_of(eye, target)).numpy()
        mask = (ids == world.bodies.index(towel)).astype(np.uint8)
        rim = cv2.morphologyEx(mask, cv2.MORPH_GRADIENT, np.ones((5, 5))) > 0
        inner = cv2.erode(mask, np.ones((15, 15))) > 0
        rim[:, :330] = inner[:, :330] = False  # the panel
        grey = picture.mean(axis=2)
        assert np.percentile(grey[rim], 10) < 0.75 * np.median(grey[inner])
        for kind in ("mousePressed", "mouseReleased"):
            browser.call(
                "Input.dispatchMouseEvent", type=kind, x=WIDTH // 2, y=HEIGHT // 2, button="left", clickCount=1
            )
        browser.wait_for("document.getElementById('name').textContent === 'towel'")
        browser.evaluate("document.getElementById('attach').click()")
        browser.wait_for("document.getElementById('attach').textContent === 'Detach'")
        assert towel.is_dynamic
        browser.evaluate("document.getElementById('one').click()")
        browser.wait_for("document.getElementById('clock').textContent === 't = 0.02 s'")
        browser.evaluate("(e => { e.value = 'layer'; e.onchange({ target: e }); })(document.getElementById('color'))")
        browser.evaluate("(e => { e.value = 'height'; e.onchange({ target: e }); })(document.getElementById('value'))")
        browser.wait_for("document.querySelectorAll('#plots canvas').length === 1")
        shown = "[...nuno.things.values()].find((t) => t.path[1] === 'towel')"
        browser.wait_for(f"{shown}.skin.material.vertexColors")
        picture = browser.picture()
        save_picture(picture, tmp_path / "controls.png")
        red, green, blue_ = picture[inner].astype(int).T
        # nothing lies below it: viridis begins with a dark violet
        assert np.median(blue_ - green) > 20 and np.median(red - green) > 10
        browser.evaluate("document.getElementById('reset').click()")
        browser.wait_for("document.getElementById('clock').textContent === 't = 0.00 s'")
        assert not towel.is_dynamic
        assert browser.complaints == []
    browser.wait_for("!document.getElementById('notice').hidden")


@needs_chromium
def test_the_documentation_shows_the_page(tmp_path):
    """Its picture of the viewer is what a browser shows now, but for fonts."""
    viewer_page(tmp_path / "viewer_page.png")
    shown = cv2.imread(str(tmp_path / "viewer_page.png"))
    kept = cv2.imread(str(Path(__file__).parents[2] / "docs" / "images" / "viewer.webp"))
    assert shown.shape == kept.shape
    small = [cv2.resize(image, None, fx=0.125, fy=0.125, interpolation=cv2.INTER_AREA) for image in (shown, kept)]
    off = np.abs(small[0].astype(float) - small[1]).mean()
    assert off < 2.0, "stale: python docs/make_pictures.py viewer_page"
