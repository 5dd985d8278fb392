"""Imagined folds: the cloth moved by the hands' paths, one world for every guess at its material."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.estimate.hand_path import HandPath
from nuno.materials import Cloth
from nuno.shapes.path import Path
from nuno.shapes.surface import SurfacePoints

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.joints.grip import Grip
    from nuno.world.world import World

SOON = 1e-4
"""[s] Events nearer than this to a frame of the world happen at that frame."""
NEAR_A_VERTEX = 0.25
"""[cells] A point this near to a vertex is held by the vertex: yarns then end at what is held, and one pass of the
solver carries their load to it. Points inside a face take three times as many substeps to hold an edge as tight."""


@dataclass(frozen=True, eq=False)
class Hold:
    """One hold of one hand.

    Attributes:
        hand: Which hand.
        begin: [s] of the video.
        end: [s], infinity where it was not let go.
        away: How far the cloth was from the hand as it took hold, in the world where it was nearest [m].
        held_cloth: Whether it held any cloth.
        faces: (worlds,) int, the face that is held, -1 where the hand did not touch.
        barycentric: (worlds, 3) float, where on that face.
    """

    hand: int
    begin: float
    end: float
    away: float
    held_cloth: bool
    faces: np.ndarray
    barycentric: np.ndarray


@dataclass(frozen=True, eq=False)
class ImaginedFold:
    """A batch of replayed folds.

    Attributes:
        world: The batch, at its last frame.
        body: The cloth in it.
        origin: The single world that it was imagined from.
        times: (s,) float [s] of the video, when states were kept.
        states: (s, worlds, n, 3) float32 [m].
        holds: What the hands held.
    """

    world: World
    body: Body
    origin: World
    times: np.ndarray
    states: np.ndarray
    holds: tuple[Hold, ...]

    def at(self, times: np.ndarray, world: int) -> np.ndarray:
        """Return the cloth of one world at times (k,) [s]: (k, n, 3) [m], on straight lines between states."""
        after = np.clip(np.searchsorted(self.times, times), 1, len(self.times) - 1)
        begin, end = self.times[after - 1], self.times[after]
        share = np.clip((times - begin) / (end - begin), 0.0, 1.0)[:, None, None]
        return (1.0 - share) * self.states[after - 1, world] + share * self.states[after, world]


def batched(materials: Sequence[Cloth]) -> Cloth:
    """Return one material that has the values of one of ``materials`` in each world."""
    if len(materials) == 1:
        return materials[0]

    def values(name: str) -> Any:
        each = [getattr(material, name) for material in materials]
        if name in Cloth.DIRECTED:
            pairs = [value if isinstance(value, tuple) else (value, value) for value in each]
            return tuple(np.array([pair[k] for pair in pairs]) for k in (0, 1))
        return np.array(each)

    return Cloth(**{item.name: values(item.name) for item in fields(Cloth)})


def imagine_fold(
    world: World, cloth: Body, hands: Sequence[HandPath], materials: Sequence[Cloth], *, begin: float, end: float,
    reach: float,
) -> ImaginedFold:  # fmt: skip
    """Let the hands move the cloth from ``begin`` to ``end`` [s] of the video, once for each material.

    A hand takes the cloth's point that is nearest as its hold begins, and keeps it at that offset until it lets go.

    Args:
        world: A single world, with the cloth as a static body.
        cloth: The cloth.
        hands: Their paths.
        materials: One for each world of the batch.
        begin: [s]
        end: [s]
        reach: A hand that is farther than this from the cloth takes nothing [m].

    Raises:
        InvalidInputError: no hand ever holds, or none that holds touches the cloth.
        SimulationDiverged: a state stopped being finite.
    """
    holds = sorted(
        (max(a, begin), b, h) for h, hand in enumerate(hands) for a, b in hand.holds if b > begin and a < end
    )
    if not holds:
        raise InvalidInputError(f"no hand holds anything between {begin:.2f} s and {end:.2f} s; held is never true")
    futures = world.imagine(len(materials))
    body = futures.find(cloth.name)
    futures.attach(body, batched(materials))
    done: list[Hold] = []
    active: list[tuple[float, Grip]] = []

    def vertices() -> np.ndarray:
        now = np.asarray(body.vertices)
        return now[None] if now.ndim == 2 else now

    times, states = [begin], [vertices().astype(np.float32)[None]]
    step, frame, now = 1.0 / futures.frame_rate, 0, begin
    while True:
        while active and active[0][0] <= now + SOON:
            active.pop(0)[1].release()
        while holds and holds[0][0] <= now + SOON:
            a, b, h = holds.pop(0)
            hold, grip = _take(futures, body, vertices(), hands[h], h, (a, b), begin, reach)
            done.append(hold)
            if grip is not None:
                active = sorted([*active, (b, grip)], key=lambda item: item[0])
        if not holds and not active and not any(hold.held_cloth for hold in done):
            nearest = min(done, key=lambda hold: hold.away)
            raise InvalidInputError(
                f"the hands never touch the cloth: hand {nearest.hand} is nearest, {nearest.away:.3f} m away as it "
                f"takes hold at t = {nearest.begin:.2f} s; within {reach:.3f} m it would hold the cloth"
            )
        if now >= end - SOON:
            break
        events = [b for b, _ in active] + [hold[0] for hold in holds]
        stop = min([end, *(t for t in events if t > now + SOON)])
        goals = []
        while now < stop - SOON:
            now = min(begin + (frame + 1) * step, stop)
            if now >= begin + (frame + 1) * step - SOON:
                frame = math.floor((now - begin) / step + 0.01)
            goals.append(now)
        found = futures.trace(body, np.array(goals) - begin)
        times += goals
        states.append(found.reshape(len(goals), len(materials), -1, 3))
    return ImaginedFold(futures, body, world, np.array(times), np.concatenate(states), tuple(done))


def _take(
    futures: World, body: Body, vertices: np.ndarray, hand: HandPath, number: int, span: tuple[float, float],
    begin: float, reach: float,
) -> tuple[Hold, Grip | None]:  # fmt: skip
    """Grip what is nearest to a hand in each world, where it is within reach."""
    at = hand.at(span[0])
    points = body.closest(np.broadcast_to(at, (len(vertices), 1, 3)) if len(vertices) > 1 else at[None])
    faces, weights = points.faces.reshape(-1, 1), points.barycentric.reshape(-1, 1, 3)
    held = SurfacePoints(faces, weights).positions(vertices, body.faces)[:, 0]
    away = np.linalg.norm(held - at, axis=-1)
    held_cloth = away <= reach
    corners = body.faces[faces[:, 0]]
    rows = np.arange(len(vertices))
    distances = np.linalg.norm(vertices[rows[:, None], corners] - held[:, None], axis=-1)
    chosen = distances.argmin(axis=1)
    where: Any
    if (distances[rows, chosen] <= NEAR_A_VERTEX * _cell(vertices, body.faces))[held_cloth].all():
        weights = np.eye(3)[chosen][:, None]
        vertex = corners[rows, chosen]
        held = vertices[rows, vertex]
        where = np.where(held_cloth, vertex, -1)[:, None]
    else:
        masked = np.where(held_cloth[:, None], faces, -1)
        where = SurfacePoints(masked, weights) if len(vertices) > 1 else SurfacePoints(masked[0], weights[0])
    faces = np.where(held_cloth, faces[:, 0], -1)
    hold = Hold(number, *span, float(away.min()), bool(held_cloth.any()), faces, weights[:, 0])
    if not hold.held_cloth:
        return hold, None
    later = hand.times > span[0]
    times = np.append(span[0], hand.times[later])
    way = np.concatenate([at[None], hand.positions[later]]) + (held - at)[:, None]
    path = Path(times - begin, way if len(vertices) > 1 else way[0])
    return hold, futures.grip(
        body, where if len(vertices) > 1 or isinstance(where, SurfacePoints) else where[0], to=path
    )


def _cell(vertices: np.ndarray, faces: np.ndarray) -> float:
    """The shortest edge of the faces in the first world, on average [m]."""
    corners = vertices[0][faces]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).min(axis=1).mean())
