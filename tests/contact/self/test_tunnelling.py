"""Nothing passes through: fast cloths, thin plates, meshes, edges."""

import numpy as np
import pytest

import nuno

THICKNESS = 0.004


def as_mesh(body):
    """Return a mesh body of the triangles that a body is drawn with."""
    return nuno.mesh((body.vertices, body.faces))


def plate(kind, thickness):
    """Return a plate of 0.5 m with its upper face at z = 0."""

    def box():
        return nuno.box((0.5, 0.5, thickness), position=(0, 0, -0.5 * thickness))

    flat = np.array([[-0.25, -0.25, 0], [0.25, -0.25, 0], [0.25, 0.25, 0], [-0.25, 0.25, 0]])
    made = {
        "box": box,
        "mesh": lambda: as_mesh(box()),
        "disc": lambda: nuno.cylinder(0.35, thickness, position=(0, 0, -0.5 * thickness)),
        "shell": lambda: nuno.mesh((flat, np.array([[0, 1, 2], [0, 2, 3]]))),
        "sheet": lambda: nuno.sheet((0.5, 0.5), cells=(7, 7), position=(0, 0, -0.5 * THICKNESS)),
    }
    return made[kind]()


def thrown(sheet, speed, *others, substeps=None, gravity=(0, 0, -9.81)):
    """Return a world in which a sheet is dynamic and has a speed [m/s] downwards."""
    world = nuno.World(device="cpu", substeps=substeps, gravity=gravity)
    for other in others:
        world.add(other)
    world.add(sheet)
    world.attach(sheet, nuno.Cloth(thickness=THICKNESS, air_drag=0.0))
    solver = sheet._dynamics.solver
    velocities = np.broadcast_to([0.0, 0.0, -speed], solver.positions().shape)
    solver.set_state(solver.positions(), velocities.copy())
    return world


@pytest.mark.parametrize("substeps", [10, 20])  # 10 is the fewest that the solver takes by itself
@pytest.mark.parametrize("speed", [5.0, 9.0])
@pytest.mark.parametrize(
    ("kind", "thickness"),
    [("box", 0.01), ("box", 0.001), ("mesh", 0.01), ("mesh", 0.001), ("disc", 0.001), ("shell", 0.0), ("sheet", 0.0)],
)
def test_a_fast_cloth_stops_at_a_thin_plate(kind, thickness, speed, substeps):
    """Invariant: a sheet that comes at 5 or 9 m/s, 15 mm a substep, stays half its thickness above a plate."""
    sheet = nuno.sheet((0.3, 0.3), cells=(10, 10), position=(0, 0, 0.03))
    world = thrown(sheet, speed, plate(kind, thickness), substeps=substeps)
    lowest = 1.0
    for _ in range(60):
        world.run(1.0 / 240.0)
        lowest = min(lowest, sheet.vertices[:, 2].min())
    assert lowest > 0.5 * THICKNESS - 1e-5  # float32
    assert np.abs(sheet.velocities).max() < 0.1


@pytest.mark.parametrize("kind", ["box", "mesh", "shell"])
def test_a_thin_bat_takes_a_cloth_along(kind):
    """Invariant: a plate of 1 mm that is swung edge first, then flat, at 5 m/s never has cloth on both sides."""
    bat = plate(kind, 0.001).rotate(0.5 * np.pi, "y").locate((0, 0, 0))
    # what moves is the face that was at z = 0, now at x = 0 or 0.5 mm
    sheet = nuno.sheet((0.3, 0.3), cells=(15, 15)).rotate(0.5 * np.pi, "y").locate((0.05, 0, 0))
    world = nuno.World(device="cpu", gravity=(0, 0, 0))
    world.add(bat)
    world.add(sheet)
    world.attach(sheet, nuno.Cloth(thickness=THICKNESS, air_drag=0.0))
    world.move(bat, nuno.Path([0.0, 0.2], [(0, 0, 0), (1.0, 0, 0)]))
    face = 0.0 if kind == "shell" else 0.0005
    for _ in range(48):
        world.run(1.0 / 240.0)
        assert (sheet.vertices[:, 0] - bat.position[0]).min() > face + 0.5 * THICKNESS - 1e-4
    np.testing.assert_allclose(sheet.velocities[:, 0].mean(), 5.0, rtol=0.01)  # it does not bounce


def l_shape():
    """Return the vertices and faces of a concave solid: an L of 0.1 m legs, 0.4 m long along y."""
    outline = np.array([[0, 0], [0.2, 0], [0.2, 0.1], [0.1, 0.1], [0.1, 0.2], [0, 0.2]])
    front = np.column_stack([outline[:, 0], np.full(6, -0.2), outline[:, 1]])
    back = front + np.array([0, 0.4, 0])
    cap = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = [*cap, *((a + 6, c + 6, b + 6) for a, b, c in cap)]
    for a in range(6):
        b = (a + 1) % 6
        faces += [(a, a + 6, b), (b, a + 6, b + 6)]
    return np.concatenate([front, back]) - [0.1, 0, 0.1], np.array(faces)


def depth_in_l(x):
    """Return how deep points are inside `l_shape` [m], negative outside."""

    def box(low, high):
        return np.minimum(x - low, np.asarray(high) - x).min(axis=-1)

    return np.maximum(box([-0.1, -0.2, -0.1], [0.1, 0.2, 0.0]), box([-0.1, -0.2, -0.1], [0.0, 0.2, 0.1]))


def test_a_cloth_lies_in_the_corner_of_a_concave_mesh():
    """Invariant: at 5 m/s onto an L, no vertex is nearer to a face than half the thickness."""
    body = nuno.mesh(l_shape())
    assert body.is_solid
    sheet = nuno.sheet((0.3, 0.3), cells=(15, 15), position=(0.04, 0, 0.13)).rotate(0.2, "y")
    world = thrown(sheet, 5.0, body, substeps=20)
    deepest = -1.0
    for _ in range(30):
        world.run(1.0 / 60.0)
        deepest = max(deepest, depth_in_l(sheet.vertices).max())
    assert deepest < -0.5 * THICKNESS + 2e-4  # the corner takes two pushes a substep: what gravity and the other gave


@pytest.mark.parametrize("kind", ["box", "mesh", "sphere"])
def test_what_starts_deep_inside_leaves_without_an_explosion(kind):
    """Promise of the documentation: it leaves at no more than 0.5 m/s, and gets out."""
    body = nuno.sphere(0.1) if kind == "sphere" else nuno.box((0.2, 0.2, 0.2))
    body = as_mesh(body) if kind == "mesh" else body
    sheet = nuno.sheet((0.05, 0.05), cells=(4, 4), position=(0.0, 0.01, 0.06))
    world = thrown(sheet, 0.0, body, gravity=(0, 0, 0))
    fastest = 0.0
    for _ in range(40):
        world.run(1.0 / 60.0)
        fastest = max(fastest, np.linalg.norm(sheet.velocities, axis=-1).max())
    x = sheet.vertices
    outside = np.linalg.norm(x, axis=1) - 0.1 if kind == "sphere" else np.abs(x).max(axis=1) - 0.1
    assert outside.min() > 0.5 * THICKNESS - 1e-4
    assert fastest < 0.5 + 0.25  # neighbours that leave side by side pull at each other


def test_a_towel_pulled_over_a_table_s_edge_is_never_inside():
    """Invariant: pulled down over an edge at 1 m/s, the towel's vertices stay outside of the table."""
    table = nuno.box((0.6, 0.8, 0.04), position=(-0.3, 0, -0.02))
    sheet = nuno.sheet((0.6, 0.3), cells=(30, 15), position=(-0.25, 0, 0.5 * THICKNESS))
    world = thrown(sheet, 0.0, table)
    start = sheet.vertices
    front = np.flatnonzero(start[:, 0] > 0.04)
    at = start[front].mean(axis=0)
    world.grip(
        sheet,
        front,
        to=nuno.Path([0.0, 0.1, 0.5], [at, at + np.array([0.05, 0, -0.05]), at + np.array([0.05, 0, -0.45])]),
    )
    deepest = 0.0
    for _ in range(60):
        world.run(1.0 / 120.0)
        x = sheet.vertices
        inside = np.minimum(np.minimum(-x[:, 0], x[:, 0] + 0.6), np.minimum(-x[:, 2], x[:, 2] + 0.04))
        deepest = max(deepest, inside.max())
    assert deepest < 1e-4
    assert sheet.vertices[:, 0].max() < 0.2  # it hangs from the hand
