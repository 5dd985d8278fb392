"""Trials of carrying a mat: a batch of worlds, one a trial, in which the arms walk and the mat lies on them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.body import Body
from nuno.bodies.make_bodies import plane
from nuno.errors import InvalidInputError, SimulationDiverged
from nuno.materials import Cloth, Material
from nuno.shapes import quaternion as quat
from nuno.shapes.path import Path, minimum_jerk
from nuno.shapes.shape import Box, Shape
from nuno.tasks.arm_tracks import FRAME_RATE, ArmTracks
from nuno.world.world import World

if TYPE_CHECKING:
    from nuno.tasks.mat_sight import MatSight

CHUNK = 30
"""Frames for which the arms' poses are handed over at once: what one run of the solver takes."""
EVERY = 6
"""Frames between two looks at whether the mat touches the arms."""
LIFT = 0.002
"""[m] How far above the arms the mat is let go."""
TOUCHING = 0.005
"""[m] A gap up to which the mat counts as touching: the vertices near an edge of an arm are some way from it."""
LOST = 0.3
"""[s] How long an arm must be without the mat for that to be a failure: longer than a hop of the mat."""
FALLEN = 0.25
"""[m] How much nearer to the floor the mat's middle is than when it was laid down, for that to be a failure."""
FEWER = 0.75
"""Share of the worlds of a batch up to which it is made smaller where the others have failed."""
CALM = 6.0
"""[1/s] Air drag while the mat is laid down, as if by hand: it is not still bouncing when the walk begins."""


@dataclass(frozen=True)
class CarryTrial:
    """One way of holding the mat, and what came of it.

    Attributes:
        arm_distance: Between the hands [m].
        offset_x: From the mat's centre of gravity to the middle between the hands, ahead [m].
        offset_y: Likewise to the left [m].
        value: F [m s], the less the steadier; None where the mat fell.
        failed_at: When it fell [s], from the start of the walk (negative: before it); None where it did not.
        reason: How it fell, or the error that ended the trial; "" where it was carried to the end.
    """

    arm_distance: float
    offset_x: float
    offset_y: float
    value: float | None
    failed_at: float | None
    reason: str


@dataclass(frozen=True, eq=False)
class CarryPlan(ArmTracks):
    """The plan that all trials share: the arms' tracks, and what they carry how.

    Attributes:
        mat: The mat's shape; its x and y axes lie along the robot's.
        turned: Whether the mat is turned by a quarter, its x axis to the left.
        material: Its material.
        friction: The arms' coefficient.
        hold: "support" or "grip".
    """

    mat: Shape
    turned: bool
    material: Material
    friction: float
    hold: str

    def digest(self, substeps: int | None) -> str:
        """Return a short name of all that the outcomes depend on beside the parameters."""
        made = hashlib.sha256(repr((self.mat, vars(self.material), self.friction, self.hold, substeps)).encode())
        meshes = [shape.mesh()[0] for shape in (self.mat, *self.parts)]
        for array in (*meshes, self.positions, self.quaternions, self.base, self.hands):
            made.update(np.round(array, 9).tobytes())
        return made.hexdigest()[:12]


@dataclass(frozen=True, eq=False)
class CarryOutcome:
    """The outcome of some trials.

    Attributes:
        value: (trials,) [m s], F; NaN where the mat fell.
        failed_at: (trials,) [s] from the start of the walk, NaN where it did not fall.
        reason: (trials,), "" where it did not fall.
        deviation: (frames, trials) [m], |dF| of eq. (2) from the start of the walk on.
        middle: (frames, trials, 3) [m], the mat's mean vertex from the time that it was laid down.
    """

    value: np.ndarray
    failed_at: np.ndarray
    reason: tuple[str, ...]
    deviation: np.ndarray
    middle: np.ndarray


class CarryTrials:
    """The trial of a sweep: carries mats in a batch of rooms, one a world.

    Args:
        plan: What the trials have in common.
    """

    def __init__(self, plan: CarryPlan) -> None:
        self.plan = plan

    def __call__(self, world: World, params: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return "value", "failed_at" and "reason" of trials with "arm_distance", "offset_x" and "offset_y"."""
        apart = np.abs(np.asarray(params["arm_distance"])[:, None] - self.plan.distances)
        offsets = np.stack([params["offset_x"], params["offset_y"]], axis=-1)
        found = carry(world, self.plan, apart.argmin(axis=1), offsets, drops=True)
        return {"value": found.value, "failed_at": found.failed_at, "reason": np.array(found.reason)}


def make_room(plan: CarryPlan, device: str = "auto", substeps: int | None = None) -> World:
    """Return the world that trials get copies of: the floor, the arms' shapes, and the mat without dynamics."""
    world = World(device=device, frame_rate=FRAME_RATE, substeps=substeps)
    world.add(plane(name="floor"))
    for k, part in enumerate(plan.parts):
        world.add(Body(part, name=f"arm {k}", friction=plan.friction))
    turn = quat.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(0.5 * np.pi)) if plan.turned else quat.IDENTITY
    world.add(Body(plan.mat, name="mat", quaternion=turn))
    return world


def carry(
    futures: World, plan: CarryPlan, walks: np.ndarray, offsets: np.ndarray,
    watch: Callable[[Body, float], None] | None = None, *, drops: bool = False,
) -> CarryOutcome:  # fmt: skip
    """Carry mats, each in a world of its own, all in one batch.

    Args:
        futures: Copies of the room, one a trial.
        plan: What the trials have in common.
        walks: (trials,) int, which of the plan's walks each takes.
        offsets: (trials, 2) [m], from the mat's centre of gravity to the middle between the hands, x and y.
        watch: Called with the mat and the time [s] before the first frame and after each.
        drops: Whether trials that have failed are left out once they are many. The others go on in a smaller batch,
            with the same bits; what was not simulated is NaN.

    Raises:
        SimulationDiverged: a state stopped being finite; its ``worlds`` are trials.
    """
    from nuno.tasks.mat_sight import MatSight

    mat, trials = _lay_down(futures, plan, walks, offsets), np.arange(len(walks))
    sight = MatSight(plan, EVERY, walks, futures.device)

    def look(time: float) -> None:
        dynamics: Any = mat._dynamics
        sight.see(dynamics.solver.positions_on_device(), round(time * FRAME_RATE))
        if watch is not None:
            watch(mat, time)

    look(0.0)
    begin = round(plan.settle * FRAME_RATE)
    for first, last in _pieces(begin, plan.frames):
        if first == begin:
            futures.set_material(mat, plan.material)
        if drops and first >= begin:
            going = _undecided(plan, walks, trials, first, sight)
            if 2 <= len(going) <= FEWER * len(trials):
                futures = _of_worlds(futures, np.searchsorted(trials, going))
                mat, trials = futures.find("mat"), going
                sight.go_on_with(trials)
        _lead_arms(futures, plan, walks[trials], 2 * first, 2 * last)
        try:
            futures.run((last - first) / FRAME_RATE, progress=False, each_frame=look)
        except SimulationDiverged as error:
            error.worlds = tuple(trials[list(error.worlds)].tolist())
            raise
    return judge(plan, walks, sight.middles(), sight.gaps())


def _undecided(
    plan: CarryPlan, walks: np.ndarray, trials: np.ndarray, frame: int, sight: MatSight
) -> np.ndarray:  # fmt: skip
    """Return which trials have not failed, or so lately that a loss of contact which began before may count yet."""
    gaps = sight.gaps()[: frame // EVERY + 1]
    failed_at = judge(plan, walks, sight.middles()[: frame + 1], gaps).failed_at[trials]
    now = frame / FRAME_RATE - plan.settle
    return np.asarray(trials[~(failed_at < now - LOST - EVERY / FRAME_RATE)])


def _of_worlds(batch: World, worlds: np.ndarray) -> World:
    """Return a batch of some worlds (k,) of another."""
    fewer = World(device=batch.device)
    fewer.restore(batch.save().pick(worlds))
    return fewer


def judge(plan: CarryPlan, walks: np.ndarray, middle: np.ndarray, gaps: np.ndarray) -> CarryOutcome:
    """Return the values and failures of trials.

    Args:
        plan: What the trials have in common.
        walks: (trials,) int.
        middle: (frames, trials, 3) [m], the mean of the mat's vertices, up to the start of the walk at least.
        gaps: (readings, trials, 2) [m], to the left and the right arm, every ``EVERY`` frames.
    """
    base = plan.base[walks][:, ::2].transpose(1, 0, 2)[: len(middle)]
    start = round(plan.settle * FRAME_RATE)
    apart = middle - base
    deviation = np.linalg.norm(apart[start:] - apart[start], axis=-1)
    # eq. (3), the integral by trapezia from frame to frame
    value = (0.5 * (deviation[1:] + deviation[:-1])).sum(axis=0) / FRAME_RATE
    sunk = apart[0, :, 2] - apart[..., 2] > FALLEN
    reading = EVERY / FRAME_RATE
    needed = max(1, round(LOST / reading))
    reach = TOUCHING + (0.5 * float(np.max(plan.material.thickness)) if isinstance(plan.material, Cloth) else 0.0)
    failed_at = np.full(len(walks), np.nan)
    reasons = []
    for k in range(len(walks)):
        found = []
        if sunk[:, k].any():
            found.append((int(np.argmax(sunk[:, k])) / FRAME_RATE, f"fell by more than {FALLEN:.2f} m"))
        if plan.hold == "support":
            found += _losses(gaps[:, k] > reach, needed, reading)
        if found:
            time, reason = min(found)
            failed_at[k], value[k] = time - plan.settle, np.nan
            reasons.append(reason)
        else:
            reasons.append("")
    return CarryOutcome(value, failed_at, tuple(reasons), deviation, middle)


def _losses(apart: np.ndarray, needed: int, reading: float) -> list[tuple[float, str]]:
    """Return when (k, 2) readings say that an arm was without the mat for so many in a row, and which arm."""
    names = ("left arm", "right arm")
    found = []
    for side in range(2):
        run = 0
        for k in range(1, len(apart)):  # the 0th is before the mat has come down
            run = run + 1 if apart[k, side] else 0
            if run == needed:
                both = apart[k - needed + 1 : k + 1, 1 - side].all()
                lost = "both arms" if both else f"the {names[side]}"
                found.append(((k - needed + 1) * reading, f"lost contact with {lost}"))
                break
    return found


def _lay_down(futures: World, plan: CarryPlan, walks: np.ndarray, offsets: np.ndarray) -> Body:
    """Put the arms where they begin and the mats just above them, with dynamics from now on."""
    _lead_arms(futures, plan, walks, 0, 2)
    mat = futures.find("mat")
    places = laid_places(plan, walks, offsets)
    mat.locate(places if len(walks) > 1 else places[0])
    futures.ignore_contact(mat, mat)
    futures.attach(mat, replace(plan.material, air_drag=CALM))  # type: ignore[call-arg]
    if plan.hold == "grip":
        _grip_edges(futures, mat, plan, walks, offsets, places)
    return mat


def laid_places(plan: CarryPlan, walks: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Return where the mats' centres begin, (trials, 3) [m]: above the highest part of the arms under them.

    Raises:
        InvalidInputError: there is no arm under one.
    """
    half = 0.5 * mat_size(plan.mat, plan.turned)
    thick = float(np.max(plan.material.thickness)) if isinstance(plan.material, Cloth) else 2.0 * half[2]
    clouds = [_surface_points(plan, walk) for walk in range(len(plan.distances))]
    places = np.empty((len(walks), 3))
    for k, (walk, offset) in enumerate(zip(walks, offsets, strict=True)):
        centre = plan.hands[walk, 0].mean(axis=0)[:2] - offset
        points = clouds[walk]
        under = (np.abs(points[:, :2] - centre) < half[:2]).all(axis=1)
        if not under.any():
            raise InvalidInputError(
                f"no arm is under a mat whose centre is {offset[0]:.3f} m behind the hands and {offset[1]:.3f} m to "
                "their right"
            )
        places[k] = (*centre, points[under, 2].max() + 0.5 * thick + LIFT)
    return places


def check_trunk(plan: CarryPlan, walks: np.ndarray, offsets: np.ndarray) -> None:
    """Check that no mat begins inside the trunk.

    Raises:
        InvalidInputError: one would.
    """
    half = 0.5 * mat_size(plan.mat, plan.turned)
    trunk = [s for s in range(len(plan.parts)) if plan.sides[s] < 0]
    for walk, offset, place in zip(walks, offsets, laid_places(plan, walks, offsets), strict=True):
        for s in trunk:
            vertices = plan.parts[s].mesh()[0]
            points = quat.rotate(plan.quaternions[walk, s, 0], vertices) + plan.positions[walk, s, 0]
            if ((points.min(axis=0) < place + half) & (points.max(axis=0) > place - half)).all():
                raise InvalidInputError(
                    f"with the hands {offset[0]:.3f} m ahead of its centre the mat reaches into the trunk by "
                    f"{points[:, 0].max() - place[0] + half[0]:.3f} m; smaller offsets in x, or hands farther ahead"
                )


def mat_size(mat: Any, turned: bool) -> np.ndarray:
    """Return a mat's size (3,) [m] along the robot's axes."""
    size = np.ptp(mat.mesh()[0], axis=0)
    return size[[1, 0, 2]] if turned else size


def _surface_points(plan: CarryPlan, walk: int) -> np.ndarray:
    """Return points (k, 3) [m] all over the arms' shapes as they stand."""
    clouds = []
    for s, part in enumerate(plan.parts):
        if plan.sides[s] < 0:
            continue
        vertices, faces = part.mesh()
        # the corners alone may all be beside the mat
        a, b, c = (vertices[faces[:, k]][:, None, None] for k in range(3))
        steps = np.linspace(0.0, 1.0, 7 if isinstance(part, Box) else 3)
        u, v = (grid[None, ..., None] for grid in np.meshgrid(steps, steps, indexing="ij"))
        vertices = (a + u * (1.0 - v) * (b - a) + u * v * (c - a)).reshape(-1, 3)
        clouds.append(quat.rotate(plan.quaternions[walk, s, 0], vertices) + plan.positions[walk, s, 0])
    return np.concatenate(clouds)


def _pieces(begin: int, frames: int) -> list[tuple[int, int]]:
    """Return the first and last frames of runs of at most ``CHUNK`` frames, one of which starts at ``begin``."""
    starts = [*range(0, begin, CHUNK), *range(begin, frames, CHUNK)]
    return list(zip(starts, [*starts[1:], frames], strict=True))


def _lead_arms(futures: World, plan: CarryPlan, walks: np.ndarray, first: int, last: int) -> None:
    """Set the arms on their way from one key to another."""
    times = plan.times[first : last + 1]
    alone = futures.world_count == 1
    for k in range(len(plan.parts)):
        places = plan.positions[walks, k, first : last + 1]
        turns = plan.quaternions[walks, k, first : last + 1]
        futures.move(f"arm {k}", Path(times, places[0], turns[0]) if alone else Path(times, places, turns))


def _grip_edges(
    futures: World, mat: Body, plan: CarryPlan, walks: np.ndarray, offsets: np.ndarray, places: np.ndarray
) -> None:
    """Have each hand take the edge on its side where it is level with the hand, and bring it to itself."""
    vertices = np.broadcast_to(mat.vertices, (len(walks), *mat.vertices.shape[-2:]))[0] - places[0]
    half = 0.5 * mat_size(plan.mat, plan.turned)
    keys = plan.times[::2]
    close = max(1, int(0.8 * plan.settle * FRAME_RATE))
    share = np.clip(np.arange(len(keys)) / close, 0.0, 1.0)
    share = minimum_jerk(share)
    for side, sign in enumerate((1.0, -1.0)):
        edge = np.flatnonzero(vertices[:, 1] * sign > half[1] - 1e-6)
        held = []
        for offset in offsets:
            gap = np.abs(vertices[edge, 0] - offset[0])
            held.append(edge[np.argsort(gap, kind="stable")[: max(2, len(edge) // 4)]])
        chosen = np.array(held)
        start = vertices[chosen].mean(axis=1) + places
        hand = plan.hands[walks][:, ::2, side]
        goal = hand + np.array([0.0, 0.0, 1.0]) * (places[:, None, 2:] - hand[:, :1, 2:])
        way = start[:, None] + share[:, None] * (goal - start[:, None])
        futures.grip(mat, chosen if len(walks) > 1 else chosen[0], to=Path(keys, way if len(walks) > 1 else way[0]))
