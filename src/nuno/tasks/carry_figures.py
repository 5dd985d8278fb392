"""Pictures of carrying: a trial at several times, and F over the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from nuno.bodies.make_bodies import mesh
from nuno.camera.camera import Camera
from nuno.shapes.color import rgb
from nuno.tasks.look_at_camera import look_at_camera
from nuno.world.world import World

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nuno.robot.humanoid import Humanoid
    from nuno.tasks.carry_trials import CarryPlan, CarryTrial

WIDTH, HEIGHT, FOCAL = 400, 480, 560.0
"""[px] Of each picture."""
EYE = np.array([1.75, -1.75, 1.75])
"""[m] Where the camera is, seen from the robot's feet at the start of the walk, and"""
AIM = np.array([0.45, 0.0, 0.85])
"""[m] what it looks at."""
MAT, TILE = "steelblue", 0.25  # colour, and edge of the floor's tiles [m]
LAMP = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])
AMBIENT = 0.4


class Carries(Protocol):
    """Trials as their pictures take them; `CarryResult` says what each member is."""

    @property
    def trials(self) -> tuple[CarryTrial, ...]:
        """By arm distance, then offset in x, then in y."""

    @property
    def plan(self) -> CarryPlan:
        """The plan that all trials had in common."""

    @property
    def robot(self) -> Humanoid | None:
        """The robot; None where its tracks were given."""

    @property
    def walk_of(self) -> np.ndarray:
        """(trials,) int, the walk that each took."""

    @property
    def values(self) -> np.ndarray:
        """(trials,) float [m s]."""

    @property
    def failed(self) -> np.ndarray:
        """(trials,) bool, where the mat fell."""

    def offsets(self) -> np.ndarray:
        """Return the offsets of each trial, (trials, 2) [m]."""

    def replay(self, trial: int, times: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return the mat's vertices at some times of a trial."""


def carry_strip(result: Carries, trial: int, count: int) -> Figure:
    """Draw a trial at ``count`` times, with Matplotlib and without pyplot."""
    from matplotlib.figure import Figure

    plan, chosen, robot = result.plan, result.trials[trial], result.robot
    assert robot is not None  # strip() asks
    times = np.linspace(0.0, plan.seconds, count)
    if chosen.failed_at is not None:
        fall = chosen.failed_at
        times = np.linspace(max(-plan.settle, fall - 0.6), min(plan.seconds, fall + 0.6), count)
    vertices = result.replay(trial, times)
    faces = plan.mat.mesh()[1]
    figure = Figure(figsize=(2.2 * count, 3.1), layout="constrained", facecolor="white")
    for column, axes in enumerate(figure.subplots(1, count, squeeze=False)[0]):
        q = plan.configuration(int(result.walk_of[trial]), float(times[column]))
        axes.imshow(picture(robot, q, vertices[column], faces))
        axes.set(xticks=[], yticks=[])
        axes.set_title(f"{times[column]:.1f} s", fontsize=9)
    ended = f"F = {1000 * chosen.value:.1f} mm s" if chosen.value is not None else chosen.reason
    figure.suptitle(
        f"arms {chosen.arm_distance:.2f} m apart, hands {chosen.offset_x:+.2f} m ahead, {chosen.offset_y:+.2f} m "
        f"aside: {ended}",
        fontsize=10,
    )
    return figure


def carry_plot(result: Carries) -> Figure:
    """Draw F over the arms' distance, a panel for each offset in x and a line for each in y; crosses where it fell."""
    from matplotlib.figure import Figure

    distances = np.array([trial.arm_distance for trial in result.trials])
    offsets, values = result.offsets(), 1000.0 * result.values
    ahead, aside = np.unique(offsets[:, 0]), np.unique(offsets[:, 1])
    figure = Figure(figsize=(3.4 * len(ahead), 3.4), layout="constrained", facecolor="white")
    panels = figure.subplots(1, len(ahead), sharey=True, squeeze=False)[0]
    low = 0.0 if result.failed.all() else 0.8 * np.nanmin(values)
    for x, axes in zip(ahead, panels, strict=True):
        for k, y in enumerate(aside):
            chosen = np.flatnonzero((offsets[:, 0] == x) & (offsets[:, 1] == y))
            axes.plot(distances[chosen], values[chosen], "o-", ms=4, color=f"C{k}", label=f"{y:+.2f} m aside")
            fell = chosen[result.failed[chosen]]
            axes.plot(distances[fell], np.full(len(fell), low), "x", color=f"C{k}")
        axes.set(xlabel="arm distance [m]", title=f"hands {x:+.2f} m ahead")
        if not result.failed.all():
            axes.set_yscale("log")
        axes.grid(alpha=0.3, which="both")
    panels[0].set_ylabel("F [mm s], x: fell")
    panels[-1].legend(fontsize=8)
    return figure


def picture(robot: Humanoid, q: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return (h, w, 3) uint8: the robot's collision shapes in a configuration (nq,), and the mat."""
    kept = robot.configuration()
    world = World(device="cpu")
    try:
        robot.take_configuration(q)
        robot.enter(world)
    finally:
        robot.take_configuration(kept)
    world.add(mesh((vertices, faces), color=MAT))
    colours = np.array([*(rgb(body.color) for body in world.bodies), (0.0, 0.0, 0.0)])
    colours[:-2] = 0.35 + 0.55 * colours[:-2]  # Talos' black parts would be flat spots
    camera = look_at_camera(EYE, AIM, WIDTH, HEIGHT, FOCAL)
    depth, ids = world.depth(camera).numpy(), world.ids(camera).numpy()
    return _shaded(camera, depth, ids, colours)


def _shaded(camera: Camera, depth: np.ndarray, ids: np.ndarray, colours: np.ndarray) -> np.ndarray:
    v, u = np.mgrid[: camera.height, : camera.width]
    rays: Any = camera.rays(np.stack([u, v], axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        floor = -camera.camera_to_world[2, 3] / rays[..., 2]
    floor = np.where(floor > 0.0, floor, np.inf)
    seen = ids >= 0
    points = camera.camera_to_world[:3, 3] + rays * np.where(seen, depth, 1.0)[..., None]
    # normals from neighbours on the side where the surface goes on
    along = [_slope(points, depth, axis) for axis in (0, 1)]
    normal = np.cross(along[0], along[1])
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    normal *= np.where((normal * rays).sum(axis=-1) > 0.0, -1.0, 1.0)[..., None]
    light = AMBIENT + (1.0 - AMBIENT) * np.clip(normal @ LAMP, 0.0, 1.0)
    image = np.ones((*ids.shape, 3))
    ground = ~seen & (floor < 6.0)
    where = camera.camera_to_world[:3, 3] + rays * np.where(ground, floor, 0.0)[..., None]
    tiles = (np.floor(where[..., 0] / TILE) + np.floor(where[..., 1] / TILE)) % 2
    image[ground] = np.where(tiles > 0, 0.93, 0.86)[ground][:, None]
    image[seen] = colours[ids[seen]] * light[seen][:, None]
    return (255.0 * np.clip(image, 0.0, 1.0)).astype(np.uint8)


def _slope(points: np.ndarray, depth: np.ndarray, axis: int) -> np.ndarray:
    """Return how points (h, w, 3) change along an axis, to whichever side the depth changes less."""
    after = np.roll(points, -1, axis) - points
    before = points - np.roll(points, 1, axis)
    with np.errstate(invalid="ignore"):
        ahead = np.abs(np.roll(depth, -1, axis) - depth)
        behind = np.abs(depth - np.roll(depth, 1, axis))
        closer = np.nan_to_num(ahead, nan=np.inf) <= np.nan_to_num(behind, nan=np.inf)
    return np.where(closer[..., None], after, before)
