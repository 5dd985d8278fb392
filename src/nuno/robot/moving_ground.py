"""Moving ground: how static bodies that follow paths carry a robot that stands on them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from nuno.robot.ride import Ride, about_upright
from nuno.robot.robot_state import RobotState
from nuno.robot.static_shapes import path_of
from nuno.shapes import quaternion as quat
from nuno.tables.path_batch import GroupPath

if TYPE_CHECKING:
    from nuno.shapes.path import Path
    from nuno.world.world import World


def moving_grounds(world: World) -> dict[str, Path]:
    """Return the paths of the static bodies that follow one, by name; the links of robots are none."""
    found = {body.name: path_of(body) for body in world.bodies}
    return {name: own for name, own in found.items() if own is not None and not isinstance(own, GroupPath)}


def rides_on(
    states: Sequence[RobotState], worlds: Sequence[int], pivots: np.ndarray, feet: Sequence[str],
    grounds: Mapping[str, Path], end: float,
) -> list[Ride | None]:  # fmt: skip
    """Return how far robots are carried by the end of a frame, each in its world; None where nothing carried one yet.

    A robot goes with the mean of what bears its feet, by what each bore in the frame before.

    Args:
        states: How the robots are when the frame begins.
        worlds: In which each is.
        pivots: (k, 3) [m], the middles of their soles.
        feet: Names of the feet's links.
        grounds: Paths of what moves, by name.
        end: [s] of the frame.
    """
    given = zip(states, worlds, pivots, strict=True)
    return [_ride_on(own, w, pivot, feet, grounds, end) for own, w, pivot in given]


def earlier_ride(state: RobotState) -> Ride | None:
    """Return the ride up to a state: none yet where what is wanted begins anew from there."""
    footing = state.footing
    if footing is None or (footing.step is not None and footing.step.is_finished):
        return None
    return footing.ride


def at_rest(ride: Ride | None) -> Ride | None:
    """Return a ride whose ground stands still."""
    if ride is None or not ride.moves:
        return ride
    return Ride(ride.shift, ride.yaw, ride.pivot, np.zeros(3), 0.0, np.zeros(3))


def _ride_on(
    state: RobotState, world: int, pivot: np.ndarray, feet: Sequence[str], grounds: Mapping[str, Path], end: float
) -> Ride | None:
    before, span = earlier_ride(state), end - state.time
    forces = [
        (name, max(float(force[2]), 0.0)) for foot in feet for name, force in state.contacts.get(foot, {}).items()
    ]
    total = sum(force for _, force in forces)
    moving = [(grounds[name], force / total) for name, force in forces if name in grounds and force > 0.0]
    if not moving or span <= 0.0:
        return at_rest(before)
    ahead, back, turn = np.zeros(3), np.zeros(3), 0.0
    for path, share in moving:
        shift, yaw = _motion(path, world, pivot, state.time, end)
        ahead, turn = ahead + share * shift, turn + share * yaw
        back = back + share * _motion(path, world, pivot, state.time, state.time - span)[0]
    if turn == 0.0 and not (ahead.any() or back.any()):
        return at_rest(before)
    shift, yaw = (np.zeros(3), 0.0) if before is None else (before.shift, before.yaw)
    if turn != 0.0:  # a turn of none would leave what rounds off
        shift = quat.rotate(about_upright(turn), shift - pivot) + pivot
    acceleration = (ahead + back) / (span * span)
    return Ride(shift + ahead, yaw + turn, pivot + ahead, ahead / span, turn / span, acceleration)


def _motion(path: Path, world: int, point: np.ndarray, start: float, end: float) -> tuple[np.ndarray, float]:
    """Return how far a point (3,) of what follows a path in a world goes from one time to another, and its yaw."""
    times = np.array([start, end])
    places, turns = path.at(times), path.quaternion_at(times)
    places = places[world] if places.ndim == 3 else places
    turns = turns[world] if turns.ndim == 3 else turns
    turned = quat.multiply(turns[1], quat.inverse(turns[0]))
    shift = places[1] + quat.rotate(turned, point - places[0]) - point
    return shift, math.remainder(2.0 * math.atan2(float(turned[3]), float(turned[0])), math.tau)
