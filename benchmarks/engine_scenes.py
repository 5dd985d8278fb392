"""Twelve scenes (two picks) on the public interface alone, each with a figure that a closed form judges.

A scene puts bodies into a world that is given, and returns what measures its figure once ``seconds`` have passed. The
closed forms: a heavy elastica (Romero et al. 2021, eq. 4), Hooke, a heavy column, a beam on two supports, Coulomb,
Euler and Eytelwein, and that what hangs at rest has its centre of mass under what holds it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import nuno

GRAVITY = 9.81  # [m/s2]
Measure = Callable[[], float]


@dataclass(frozen=True)
class EngineScene:
    """A scene: how it is built, how long it runs, what its figure should be.

    Attributes:
        build: Puts the bodies into a world and returns the measurement.
        seconds: How long it runs [s].
        figure: What is measured, in words.
        unit: Of the figure.
        expected: By the closed form.
        scale: The difference from ``expected`` that counts as 100 %, in the figure's unit.
        source: The closed form, in words.
        eye: (3,) [m], where the picture is taken from.
        target: (3,) [m], what is in its middle.
    """

    build: Callable[[nuno.World], Measure]
    seconds: float
    figure: str
    unit: str
    expected: float
    scale: float
    source: str
    eye: tuple[float, float, float]
    target: tuple[float, float, float]


def cantilever(world: nuno.World) -> Measure:
    """A strip clamped level at one end, G = w L^3 / B = 5, damped so that it creeps to rest."""
    length, cells, density = 0.2, 10, 0.2
    h = length / (cells + 0.5)  # level in the middle of the first cell, both of whose rows are held
    rigidity = density * GRAVITY * length**3 / 5.0
    slowest = 3.516 * np.sqrt(rigidity / (density * length**4))  # [1/s] of a clamped beam
    strip = world.add(nuno.sheet(((cells + 1) * h, 2 * h), cells=(cells + 1, 2), name="strip", position=(0, 0, 0.3)))
    start = strip.vertices
    held = np.flatnonzero(start[:, 0] < start[:, 0].min() + 1.1 * h)
    tip = np.flatnonzero(start[:, 0] > start[:, 0].max() - 0.1 * h)
    world.ignore_contact(strip, strip)  # it does not fold
    world.attach(
        strip, nuno.Cloth(area_density=density, bending_rigidity=rigidity, thickness=1e-3, air_drag=1.5 * slowest)
    )
    clamp = start[held].mean(axis=0)
    world.grip(strip, held, to=clamp)

    def drop_over_reach() -> float:
        x, _, z = (strip.vertices[tip].mean(axis=0) - clamp).tolist()
        return -z / x

    return drop_over_reach


def hanging_strip(world: nuno.World) -> Measure:
    """A strip of 50 N/m hangs by one end."""
    length, cells = 0.6, 24
    strip = world.add(nuno.sheet((length, 0.05), cells=(cells, 2), name="strip", position=(0, 0, 0.7)))
    strip.rotate(0.5 * np.pi, "y")
    start = strip.vertices
    top = np.flatnonzero(start[:, 2] > start[:, 2].max() - 1e-6)
    low = np.flatnonzero(start[:, 2] < start[:, 2].min() + 1e-6)
    world.ignore_contact(strip, strip)
    world.attach(strip, nuno.Cloth(stretch_stiffness=50.0, shear_stiffness=25.0, thickness=1e-3, air_drag=4.0))
    world.grip(strip, top, to=start[top].mean(axis=0))
    return lambda: float(1e3 * (start[low, 2].mean() - strip.vertices[low, 2].mean()))


def hang(world: nuno.World) -> Measure:
    """A sheet falls from level and hangs by two corners."""
    sheet = world.add(nuno.sheet((0.5, 0.5), cells=(10, 10), name="cloth", position=(0, 0, 0.7)))
    start = sheet.vertices
    world.attach(sheet, nuno.Cloth(air_drag=4.0))
    corners = [0, 10]
    for corner in corners:
        world.grip(sheet, [corner], to=start[corner])
    plane = start[corners, 1].mean()
    return lambda: float(1e3 * abs(sheet.centre_of_mass[1] - plane))


def _pick(world: nuno.World, i: int, j: int) -> Measure:
    """A sheet of 0.3 m on a table is lifted by vertex (i, j) until it hangs."""
    world.add(nuno.box((0.8, 0.8, 0.04), name="table", position=(0, 0, -0.02), color="#b08050"))
    sheet = world.add(nuno.sheet((0.3, 0.3), cells=(10, 10), name="cloth", position=(0, 0, 0.002)))
    start = sheet.vertices
    vertex = j * 11 + i
    world.attach(sheet, nuno.Cloth(air_drag=4.0))
    goal = start[vertex] + (0.0, 0.0, 0.5)
    path = nuno.Path([0.0, 1.5], [start[vertex], goal], interpolation="minimum_jerk")
    world.grip(sheet, [vertex], to=path)
    return lambda: float(1e3 * np.linalg.norm((sheet.centre_of_mass - goal)[:2]))


def pick_corner(world: nuno.World) -> Measure:
    """A sheet is lifted from a table by a corner."""
    return _pick(world, 0, 0)


def pick_inner_point(world: nuno.World) -> Measure:
    """A sheet is lifted from a table by a point inside of it."""
    return _pick(world, 3, 4)


def drape_over_box(world: nuno.World) -> Measure:
    """A sheet falls over a box; nothing of it, edges included, is nearer to the box than half the thickness."""
    world.add(nuno.plane(name="floor"))
    world.add(nuno.box((0.16, 0.16, 0.2), name="box", position=(0, 0, 0.1), color="#8070b0"))
    sheet = world.add(nuno.sheet((0.4, 0.4), cells=(12, 12), name="cloth", position=(0, 0, 0.21)))
    world.attach(sheet, nuno.Cloth(air_drag=4.0, friction=0.5))
    i, j = np.meshgrid(np.arange(31), np.arange(31))
    weights = np.stack([i, j, 30 - i - j], axis=-1)[i + j <= 30] / 30.0

    def nearest_to_box() -> float:
        points = np.einsum("kc,fcx->fkx", weights, sheet.vertices[sheet.faces]).reshape(-1, 3)
        away = np.abs(points - (0.0, 0.0, 0.1)) - (0.08, 0.08, 0.1)
        outside = np.linalg.norm(np.maximum(away, 0.0), axis=1)
        return float(1e3 * (outside + np.minimum(away.max(axis=1), 0.0)).min())

    return nearest_to_box


def fold(world: nuno.World) -> Measure:
    """Two hands carry the corners of one side of a towel over to the other side, and stay."""
    size, cells, thickness = (0.4, 0.3), (12, 9), 0.004
    world.add(nuno.box((0.8, 0.8, 0.02), name="table", position=(0, 0, -0.01), color="#b08050"))
    towel = world.add(nuno.sheet(size, cells=cells, name="towel", position=(0, 0, 0.5 * thickness)))
    start = towel.vertices
    world.attach(towel, nuno.Cloth(area_density=0.25, thickness=thickness, friction=0.6, air_drag=2.0))
    columns, rows = cells[0] + 1, cells[1] + 1
    for row in (0, rows - 1):
        carried, covered = row * columns + cells[0], row * columns
        goal = start[covered] + (0.0, 0.0, thickness)
        above = 0.5 * (start[carried] + goal) + (0.0, 0.0, 0.15)
        path = nuno.Path([0.0, 1.0, 2.0], [start[carried], above, goal], interpolation="minimum_jerk")
        world.grip(towel, [carried], to=path)

    def layers_apart() -> float:
        grid = towel.vertices.reshape(rows, columns, 3)
        far = 3 * columns // 4  # beyond the bend at the fold
        return float(1e3 * (grid[:, far:] - grid[:, cells[0] - far :: -1])[..., 2].mean())

    return layers_apart


def soft_cube_landing(world: nuno.World) -> Measure:
    """A soft cube falls by 10 mm and stands on a floor without friction."""
    world.add(nuno.plane(name="floor", friction=0.0))
    cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(4, 4, 4), name="cube", position=(0, 0, 0.06)))
    top = np.flatnonzero(cube.vertices[:, 2] > 0.11 - 1e-6)
    low = np.flatnonzero(cube.vertices[:, 2] < 0.01 + 1e-6)
    world.attach(cube, nuno.Soft(density=1000.0, youngs_modulus=5e4, poisson_ratio=0.3, friction=0.0, damping=0.02))
    return lambda: float(1e3 * (0.1 - (cube.vertices[top, 2].mean() - cube.vertices[low, 2].mean())))


def cube_on_towel(world: nuno.World) -> Measure:
    """A soft cube falls by 10 mm on a towel that lies on a floor."""
    world.add(nuno.plane(name="floor"))
    towel = world.add(nuno.sheet((0.24, 0.24), cells=(8, 8), name="towel", position=(0, 0, 0.002)))
    cube = world.add(nuno.soft_box((0.1, 0.1, 0.1), cells=(3, 3, 3), name="cube", position=(0, 0, 0.064)))
    low = np.flatnonzero(cube.vertices[:, 2] < 0.014 + 1e-6)
    world.attach(towel, nuno.Cloth(thickness=0.004, air_drag=2.0))
    world.attach(cube, nuno.Soft(density=200.0, youngs_modulus=5e4, damping=0.02))
    return lambda: float(1e3 * cube.vertices[low, 2].mean())


INCLINE, SLIPPERY, SLIDING = np.radians(30.0), 0.3, 0.6  # [rad], Coulomb's coefficient, [s]


def box_on_incline(world: nuno.World) -> Measure:
    """A rigid box slides down an incline of 30 degrees, from rest, for 0.6 s."""
    ramp = nuno.box((2.0, 0.6, 0.1), name="ramp", position=(0, 0, 0), friction=SLIPPERY).rotate(INCLINE, "y")
    world.add(ramp)
    down = np.array([np.cos(INCLINE), 0.0, -np.sin(INCLINE)])
    normal = np.array([np.sin(INCLINE), 0.0, np.cos(INCLINE)])
    box = nuno.box((0.1, 0.1, 0.04), name="box", position=0.07 * normal - 0.5 * down, color="#4080c0")
    world.add(box.rotate(INCLINE, "y"))
    start = np.array(box.position)
    world.attach(box, nuno.Rigid(friction=SLIPPERY))
    return lambda: float(1e3 * (box.position - start) @ down)


def box_stack(world: nuno.World) -> Measure:
    """Five boxes stand on each other for 1 s."""
    world.add(nuno.plane(name="floor"))
    colours = ("#8070b0", "#b08050")
    boxes = [
        world.add(nuno.box((0.1, 0.1, 0.1), name=f"box {k}", position=(0, 0, 0.05 + 0.1 * k), color=colours[k % 2]))
        for k in range(5)
    ]
    start = np.array([box.position for box in boxes])
    for box in boxes:
        world.attach(box, nuno.Rigid(density=500.0))
    return lambda: float(1e3 * np.linalg.norm([box.position for box in boxes] - start, axis=1).max())


def towel_over_bar(world: nuno.World) -> Measure:
    """A limp towel hangs over a round bar with twice as much on one side, where exp(mu pi) = 4.8 holds it."""
    radius, thickness, h, long, short = 0.03, 0.002, 0.0125, 0.24, 0.12
    bar = nuno.cylinder(radius, 0.3, name="bar", position=(0, 0, 0.4), color="#b08050").rotate(0.5 * np.pi, "x")
    world.add(bar)
    r = radius + 0.5 * thickness
    cells = round((np.pi * r + long + short) / h)
    s = np.arange(cells + 1) * h - short  # along the towel, 0 where the arc begins
    angle = np.clip(s / r, 0.0, np.pi)
    x = -r * np.cos(angle)
    z = 0.4 + r * np.sin(angle) + np.minimum(s, 0.0) - np.maximum(s - np.pi * r, 0.0)
    y = h * np.arange(9) - 4 * h
    shape = np.stack([np.tile(x, 9), np.repeat(y, cells + 1), np.tile(z, 9)], axis=1)
    flat = np.stack([np.tile(s, 9), np.repeat(y, cells + 1)], axis=1)
    a = (np.arange(8)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    b, c, d = a + 1, a + cells + 1, a + cells + 2
    odd = (np.arange(8)[:, None] + np.arange(cells)).ravel() % 2 == 1
    faces = np.concatenate(
        [np.where(odd[:, None], np.stack([a, b, c], 1), np.stack([a, b, d], 1)),
         np.where(odd[:, None], np.stack([b, d, c], 1), np.stack([a, d, c], 1))]
    )  # fmt: skip
    towel = world.add(nuno.cloth_mesh(shape, faces, flat, name="towel"))
    low = np.flatnonzero(s[None].repeat(9, 0).ravel() > s[-1] - 1e-6)
    start = towel.vertices[low, 2].mean()
    world.ignore_contact(towel, towel)
    world.attach(towel, nuno.Cloth(thickness=thickness, bending_rigidity=1e-6, friction=0.5, air_drag=2.0))
    bar.friction = 0.5
    return lambda: float(1e3 * (start - towel.vertices[low, 2].mean()))


SPAN, OVERHANG, ARM, MAT, STIFF = 0.24, 0.03, 0.02, 0.5, 0.02  # [m], [m], [m], [kg/m2], [N m]


def mat_on_two_arms(world: nuno.World) -> Measure:
    """A stiff mat lies across two round arms without friction and sags between them."""
    thickness = 0.004
    for side in (-1, 1):
        at = (0.5 * SPAN * side, 0, 0.3 - ARM - 0.5 * thickness)
        arm = nuno.cylinder(ARM, 0.3, name="arm", position=at, friction=0.0, color="#b08050")
        world.add(arm.rotate(0.5 * np.pi, "x"))
    mat = world.add(nuno.sheet((SPAN + 2 * OVERHANG, 0.12), cells=(20, 8), name="mat", position=(0, 0, 0.3)))
    world.ignore_contact(mat, mat)
    world.attach(
        mat, nuno.Cloth(area_density=MAT, bending_rigidity=STIFF, thickness=thickness, friction=0.0, air_drag=8.0)
    )
    middle = np.flatnonzero(np.abs(mat.vertices[:, 0]) < 1e-6)
    return lambda: float(1e3 * (0.3 - mat.vertices[middle, 2].mean()))


def _sag_on_arms() -> float:
    """Return 5 w s^4 / (384 B) - w a^2 s^2 / (16 B) [mm] of a beam with overhangs (any book on beams).

    The mat touches the arms where it is as steep as they are, nearer to the middle than their tops; s and a are between
    those points. They also lie lower than the tops, by half the slope times how far they are from them.
    """
    slope, radius = 0.0, ARM + 0.002
    w, half = MAT * GRAVITY, 0.5 * SPAN
    for _ in range(50):
        s, a = 2 * (half - radius * np.sin(slope)), OVERHANG + radius * np.sin(slope)
        slope = np.arctan(w * s**3 / (24 * STIFF) - w * a**2 * s / (4 * STIFF))
    sag = 5 * w * s**4 / (384 * STIFF) - w * a**2 * s**2 / (16 * STIFF)
    return float(1e3 * (sag + radius * (1 - np.cos(slope))))


def _extension() -> float:
    return 1e3 * 0.2 * GRAVITY * 0.6**2 / (2 * 50.0)  # w L^2 / (2 E t) [mm]


def _slide() -> float:
    return 1e3 * 0.5 * GRAVITY * (np.sin(INCLINE) - SLIPPERY * np.cos(INCLINE)) * SLIDING**2  # [mm]


PLUMB = "at rest the centre of mass is under what holds it"
SCENES = {
    "cantilever": EngineScene(
        cantilever, 2.5, "drop over reach", "1", 0.58572, 0.58572, "elastica at G = 5 (Romero et al. 2021)",
        (0.1, -0.45, 0.35), (0.0, 0.0, 0.25),
    ),
    "hanging strip": EngineScene(
        hanging_strip, 2.5, "extension", "mm", _extension(), _extension(), "w L^2 / (2 E t)",
        (0.9, -0.9, 0.8), (0.0, 0.0, 0.68),
    ),
    "hang": EngineScene(
        hang, 2.5, "centre of mass beside the plumb", "mm", 0.0, 250.0, PLUMB, (0.9, -1.1, 0.7), (0.0, -0.2, 0.45),
    ),
    "pick corner": EngineScene(
        pick_corner, 2.5, "centre of mass beside the plumb", "mm", 0.0, 212.0, PLUMB, (0.6, -0.9, 0.6),
        (-0.1, -0.1, 0.25),
    ),
    "pick inner point": EngineScene(
        pick_inner_point, 2.5, "centre of mass beside the plumb", "mm", 0.0, 67.0, PLUMB, (0.6, -0.9, 0.6),
        (0.0, 0.0, 0.25),
    ),
    "drape over box": EngineScene(
        drape_over_box, 1.5, "nearest to the box", "mm", 2.0, 2.0, "half the thickness", (0.5, -0.6, 0.5),
        (0.0, 0.0, 0.1),
    ),
    "fold": EngineScene(
        fold, 2.2, "layers apart", "mm", 4.0, 4.0, "the thickness", (0.15, -0.42, 0.25), (-0.08, 0.0, 0.0),
    ),
    "soft cube landing": EngineScene(
        soft_cube_landing, 1.5, "sinks by its weight", "mm", 1e3 * 1000.0 * GRAVITY * 0.1**2 / (2 * 5e4),
        1e3 * 1000.0 * GRAVITY * 0.1**2 / (2 * 5e4), "rho g h^2 / (2 E), nothing rubs", (0.2, -0.3, 0.2),
        (0.0, 0.0, 0.05),
    ),
    "cube on towel": EngineScene(
        cube_on_towel, 1.0, "height over the floor", "mm", 4.0, 4.0, "the towel's thickness", (0.3, -0.4, 0.25),
        (0.0, 0.0, 0.04),
    ),
    "box on incline": EngineScene(
        box_on_incline, SLIDING, "slides by", "mm", _slide(), _slide(), "g (sin - mu cos) t^2 / 2", (0.5, -1.4, 0.9),
        (-0.1, 0.0, 0.05),
    ),
    "box stack": EngineScene(
        box_stack, 1.0, "farthest from its place", "mm", 0.0, 100.0, "boxes at rest stay", (0.6, -0.8, 0.75),
        (0.0, 0.0, 0.22),
    ),
    "towel over bar": EngineScene(
        towel_over_bar, 1.0, "slips by", "mm", 0.0, 120.0, "sticks, as 2 < exp(mu pi) = 4.8", (0.5, -0.6, 0.4),
        (0.0, 0.0, 0.3),
    ),
    "mat on two arms": EngineScene(
        mat_on_two_arms, 1.5, "sag", "mm", _sag_on_arms(), _sag_on_arms(), "beam on two supports, overhanging",
        (0.25, -0.5, 0.4), (0.0, 0.0, 0.28),
    ),
}  # fmt: skip
