"""Lifting a soft cube between two hands: how hard they must press so that it does not slip out.

The task of Howard and Bekey ("Intelligent learning for deformable object manipulation", Autonomous Robots 9, 2000),
for which there is a closed form: two hands with friction mu hold a weight m g if 2 mu N >= m g.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from nuno.bodies.make_bodies import box, plane, soft_box
from nuno.errors import EstimationError, InvalidInputError
from nuno.files.html_table import html_table
from nuno.materials import Soft
from nuno.search.sweep import sweep
from nuno.shapes.path import Path
from nuno.validation import checked, count, number
from nuno.world.world import World

RUBBER = Soft(density=200.0, youngs_modulus=2e4, poisson_ratio=0.3, friction=0.5, damping=0.01)
CLOSE, LIFT, HOLD = 0.5, 2.0, 1.0
"""[s] How long the hands take to close and to rise, and hold the cube then."""
RISE = 0.06
"""[m] How far they rise: at most 5.8 RISE / LIFT^2 = 0.09 m/s2, 0.9 % of gravity, by a minimum jerk path."""
THICK = 0.02
"""[m] Of a hand."""
GAP = 0.002
"""[m] Between cube and hands at first."""
SETTLED = 0.5
"""[s] The last part of the hold, in which a cube that is held stays where it is, but for"""
SLIP = 0.002
"""[m] this. One whose hands bear a tenth less than its weight would fall by 120 mm in that time."""
ACROSS = 1
"""The axis along which the hands press."""


@dataclass(frozen=True, eq=False)
class LiftResult:
    """The squeezes that hold a soft cube.

    Attributes:
        squeezes: (n,) [m], how far each hand pressed into the face that it touches, rising.
        forces: (n,) [N], what a hand presses the held cube with in the air, the mean of both, as the contacts say; NaN
            where the cube was dropped. On the floor it is a third more, as the floor keeps the cube from widening.
        held: (n,) bool, whether the cube came along and stayed.
        sunk: (n,) [m], how far the cube fell behind the hands in the end.
        mass: Of the cube [kg].
        friction: Coulomb's coefficient between cube and hands.
        gravity: [m/s2].
    """

    squeezes: np.ndarray
    forces: np.ndarray
    held: np.ndarray
    sunk: np.ndarray = field(repr=False)
    mass: float
    friction: float
    gravity: float

    def _repr_html_(self) -> str:
        rows = [
            (f"{1000 * squeeze:.2f}", f"{force:.3f}" if held else "", "held" if held else "dropped")
            for squeeze, force, held in zip(self.squeezes, self.forces, self.held, strict=True)
        ]
        title = f"LiftResult: least force by Coulomb {self.closed_form:.3f} N"
        return html_table(title, rows, columns=("squeeze [mm]", "force [N]", "the cube was"))

    @property
    def closed_form(self) -> float:
        """The least force of each hand [N] by Coulomb: m g / (2 mu)."""
        return self.mass * self.gravity / (2.0 * self.friction)

    @property
    def least_force(self) -> float:
        """The least force [N] that held the cube, of those tried."""
        return float(self.forces[self._first])

    @property
    def least_squeeze(self) -> float:
        """The least squeeze [m] that held the cube, of those tried."""
        return float(self.squeezes[self._first])

    @property
    def _first(self) -> int:
        if not self.held.any():
            raise EstimationError(f"no squeeze up to {self.squeezes[-1]:.5f} m holds the cube; try more")
        return int(np.flatnonzero(self.held)[0])


class LiftTrials:
    """The trial of a sweep: lifts the cube of a world between its hands, by "squeeze" [m].

    Args:
        half: Half the cube's edge [m].
        material: The cube's.
    """

    def __init__(self, half: float, material: Soft) -> None:
        self.half, self.material = half, material

    def __call__(self, world: World, params: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return "force" [N], "sunk" [m] and "slip" [m] in the last part of the hold."""
        squeeze = np.asarray(params["squeeze"])
        cube = world.find("cube")
        world.attach(cube, replace(self.material))
        times = np.cumsum([0.0, CLOSE, CLOSE, LIFT])  # half a second to come to rest, before they rise
        for name, side in (("left hand", 1.0), ("right hand", -1.0)):
            hand = world.find(name)
            start = np.broadcast_to(hand.position, (len(squeeze), 3))
            closed = start.copy()
            closed[:, ACROSS] = side * (self.half + 0.5 * THICK - squeeze)
            raised = closed + np.array([0.0, 0.0, RISE])
            keys = np.stack([start, closed, closed, raised], axis=1)
            world.move(hand, Path(times, keys, interpolation="minimum_jerk"))
        world.run(float(times[2]), progress=False)
        low = _heights(cube)
        world.run(LIFT + HOLD - SETTLED, progress=False)
        before = _heights(cube)
        world.run(SETTLED, progress=False)
        after = _heights(cube)
        return {
            "force": _pressing(world, cube, len(squeeze)), "sunk": RISE - (after - low), "slip": before - after,
        }  # fmt: skip


@checked
def lift_soft_cube(
    edge: float = 0.1, cells: int = 5, material: Soft | None = None, *, most: float | None = None, tries: int = 16,
    rounds: int = 2, device: str = "auto", substeps: int | None = None,
) -> LiftResult:  # fmt: skip
    """Find the least squeeze with which two hands lift a soft cube from the floor.

    All squeezes of a round are tried in one batch: first evenly up to ``most``, then between the largest that dropped
    the cube and the least that held it.

    Args:
        edge: Of the cube [m].
        cells: Along each edge.
        material: Of the cube, its friction also that of the hands; None is a soft rubber.
        most: The largest squeeze [m]; None is 2.5 times that of which Hooke's law would give what Coulomb's asks for.
        tries: Squeezes in each round.
        rounds: How often the search is made finer.
        device: As of ``World``.
        substeps: As of ``World``.

    Raises:
        InvalidInputError: a value out of range, no friction, or squeezes that crush the cube.
        EstimationError: a state stopped being finite.
    """
    size, made_of = number("edge", edge, above=0.0), RUBBER if material is None else material
    if not isinstance(made_of, Soft) or np.ndim(made_of.friction) or made_of.friction <= 0.0:
        raise InvalidInputError(f"the cube needs a Soft material with one friction above 0, got {made_of!r}")
    world = _room(size, count("cells", cells), float(made_of.friction), device, substeps)
    mass, gravity = float(made_of.density) * size**3, float(np.linalg.norm(world.gravity))
    needed = mass * gravity / (2.0 * made_of.friction)
    expected = 0.5 * needed / (float(made_of.youngs_modulus) * size)  # of each hand: half of N a / (E a^2)
    high = number("most", 2.5 * expected if most is None else most, above=0.0)
    if high > 0.2 * size:
        raise InvalidInputError(
            f"a squeeze of {high:.4f} m from each side crushes a cube of {size:.4f} m; take a stiffer or rougher one"
        )
    trial = LiftTrials(0.5 * size, made_of)
    low, found = 0.0, []
    for _ in range(count("rounds", rounds)):
        # neither end, of which the last round knows
        squeezes = np.linspace(low, high, count("tries", tries) + 2)[1:-1]
        swept = sweep(trial, {"squeeze": squeezes}, world=world, batch=tries)
        for k, row in enumerate(swept.trials):
            if row is None or row.error is not None:
                raise EstimationError(f"a squeeze of {squeezes[k]:.4f} m failed: {row.error if row else 'not run'}")
        values = {name: swept.values(name) for name in ("force", "sunk", "slip")}
        found.append((squeezes, values["force"], values["sunk"], values["slip"]))
        held = _held(values["sunk"], values["slip"])
        first = int(np.flatnonzero(held)[0]) if held.any() else tries
        low, high = np.concatenate([[low], squeezes, [high]])[first : first + 2].tolist()
    squeezes, forces, sunk, slip = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order, held = np.argsort(squeezes), _held(sunk, slip)
    forces = np.where(held, forces, np.nan)
    return LiftResult(squeezes[order], forces[order], held[order], sunk[order], mass, float(made_of.friction), gravity)


def _room(size: float, cells: int, friction: float, device: str, substeps: int | None) -> World:
    """Return a world with a cube on the floor, static, between two hands."""
    world = World(device=device, substeps=substeps)
    world.add(plane(name="floor"))
    world.add(soft_box((size,) * 3, (cells,) * 3, name="cube", position=(0.0, 0.0, 0.5 * size)))
    for name, side in (("left hand", 1.0), ("right hand", -1.0)):
        # hands that reach past the faces' rims: a rim above a hand would hang on to it, whatever the friction
        place = (0.0, side * (0.5 * size + 0.5 * THICK + GAP), 0.62 * size)
        world.add(box((1.2 * size, THICK, 1.2 * size), name=name, position=place, friction=friction))
    return world


def _held(sunk: np.ndarray, slip: np.ndarray) -> np.ndarray:
    """Return True if a cube came along, by at least half of the way, and stays where it is."""
    return (sunk < 0.5 * RISE) & (slip < SLIP)


def _heights(cube: Any) -> np.ndarray:
    return np.atleast_2d(cube.vertices[..., 2]).mean(axis=-1)


def _pressing(world: World, cube: Any, worlds: int) -> np.ndarray:
    """Return the mean of what both hands press with (worlds,) [N]."""
    contacts = world.contacts(cube)
    total = np.zeros(worlds)
    for name, side in (("left hand", -1.0), ("right hand", 1.0)):
        touching = np.array([other == name for other in contacts.others], dtype=bool)
        forces = side * contacts.forces[touching, ACROSS]
        total += np.bincount(contacts.worlds[touching], forces, minlength=worlds)
    return 0.5 * total
