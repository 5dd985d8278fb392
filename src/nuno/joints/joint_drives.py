"""Drives along a joint's free direction: motors, springs, friction and stops, as users give them and as a table."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from nuno.errors import InvalidInputError
from nuno.validation import Shape, as_array, finite_array

DRIVES = (
    "lower", "upper", "friction", "stiffness", "damping", "position", "velocity", "max_effort", "spring", "rest",
    "spring_damping",
)  # fmt: skip
"""Numbers of a drive along the free direction, in the solver's order."""
Shapes = tuple[Shape, ...]
OF_ONE: Shapes = ((), ("worlds",))
OF_MANY: Shapes = (("joints",), ("worlds", "joints"))
"""The shapes that a value may have, of a joint and of many."""

SLACK = 1e-6
"""[N m s/rad] or [N s/m] Damping of a motor that has none, by which it exerts an effort."""


@dataclass(frozen=True, eq=False)
class Motor:
    """A motor of a hinge or slider; each value is a number or (worlds,).

    Without ``position`` it turns or slides at ``velocity``: exactly, as long as that takes no more than
    ``max_effort``, or with ``damping`` as a gain. With ``position`` its effort is ``stiffness`` times what is missing,
    less ``damping`` times what the velocity is over ``velocity``, and ``effort`` besides; ``effort`` alone is a motor
    under torque or force control.

    Attributes:
        velocity: [rad/s] or [m/s].
        position: [rad] or [m], or None.
        stiffness: [N m/rad] or [N/m], with ``position`` only.
        damping: [N m s/rad] or [N s/m]; None is 0 with ``position``, else endless.
        max_effort: [N m] or [N].
        effort: Besides what the gains ask for [N m] or [N]; not with a velocity that is kept exactly.

    Raises:
        InvalidInputError: a gain or limit that is negative, an effort that nothing can add to, a position without
            stiffness, or stiffness without one.
    """

    velocity: Any = 0.0
    position: Any = None
    stiffness: Any = 0.0
    damping: Any = None
    max_effort: Any = math.inf
    effort: Any = 0.0

    def __post_init__(self) -> None:
        _checked("velocity", self.velocity)
        stiffness = _checked("stiffness", self.stiffness, low=0.0)
        if self.damping is not None:
            _checked("damping", self.damping, low=0.0)
        _checked("max_effort", self.max_effort, low=0.0, endless=True)
        _checked("effort", self.effort)
        if self.position is None:
            if np.any(self.effort) and self.damping is None and np.any(self.velocity):
                raise InvalidInputError("a motor with an effort keeps no velocity exactly; give it a damping")
            if np.any(stiffness > 0.0):
                raise InvalidInputError("a motor's stiffness needs the position that it pulls to")
        else:
            _checked("position", self.position)
            if not np.all(stiffness > 0.0):
                raise InvalidInputError(f"a motor that goes to a position needs a stiffness, got {self.stiffness!r}")


@dataclass(frozen=True, eq=False)
class Spring:
    """A spring of a hinge, slider or ball; each value is a number or (worlds,).

    Attributes:
        stiffness: [N m/rad] or [N/m].
        rest: The position [rad] or [m] in which it is not stretched; of a ball joint 0.
        damping: [N m s/rad] or [N s/m].

    Raises:
        InvalidInputError: a stiffness or damping that is negative.
    """

    stiffness: Any
    rest: Any = 0.0
    damping: Any = 0.0

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping"):
            _checked(name, getattr(self, name), low=0.0)
        _checked("rest", self.rest)


def drive_table(worlds: int, values: dict[str, Any], before: np.ndarray | None = None) -> np.ndarray:
    """(worlds, 11), some of them changed."""
    table = np.zeros((worlds, len(DRIVES))) if before is None else before.copy()
    if before is None:
        table[:, 0], table[:, 1] = -np.inf, np.inf
    for name, value in values.items():
        if np.shape(value) not in ((), (worlds,)):
            raise InvalidInputError(f"{name} must be one value or ({worlds},), got shape {np.shape(value)}")
        table[:, DRIVES.index(name)] = value
    return table


def _checked(
    name: str, value: Any, *, low: float = -np.inf, endless: bool = False, shapes: Shapes = OF_ONE
) -> np.ndarray:
    if endless and as_array(name, value).ndim == 0 and value == np.inf:
        return np.array(np.inf)
    checked = finite_array(name, value, *shapes)
    if (checked < low).any():
        raise InvalidInputError(f"{name} must be at least {low:g}, got {value!r}")
    return checked


def limit_drives(kind: str, value: Any) -> dict[str, Any]:
    """Return the numbers of stops, or of a ball joint's cone; None is none.

    Raises:
        InvalidInputError: a fixed joint, or stops that are out of range or in the wrong order.
    """
    if value is None:
        return {"lower": 0.0 if kind == "ball" else -np.inf, "upper": np.inf}
    if kind == "fixed":
        raise InvalidInputError("a fixed joint has no limits")
    if kind == "ball":
        upper = _checked("limit", value, low=0.0)
        if (upper >= 3.0).any():
            raise InvalidInputError(f"limit must be below 3 rad, or None, got {value!r}")
        return {"lower": 0.0, "upper": upper}
    try:
        lower, upper = value
    except (TypeError, ValueError) as problem:
        raise InvalidInputError(f"limits must be (lower, upper), got {value!r}") from problem
    lower, upper = _checked("the lower limit", lower), _checked("the upper limit", upper)
    if (lower > upper).any():
        raise InvalidInputError(f"the lower limit must not be above the upper, got {value!r}")
    if kind == "hinge" and ((lower < -np.pi).any() or (upper > np.pi).any()):
        raise InvalidInputError(f"a hinge's limits must lie within -pi and pi, got {value!r}")
    return {"lower": lower, "upper": upper}


def friction_drives(kind: str, value: Any) -> dict[str, Any]:
    """Return the number of a joint's friction.

    Raises:
        InvalidInputError: a fixed joint, or friction that is negative.
    """
    if kind == "fixed":
        raise InvalidInputError("a fixed joint has no friction")
    return {"friction": _checked("friction", value, low=0.0)}


def motor_drives(kind: str, value: Motor | None) -> dict[str, Any]:
    """Return the numbers of a motor, or of none.

    Raises:
        InvalidInputError: no motor, or a joint that has none.
    """
    if value is None:
        return dict.fromkeys(("stiffness", "damping", "position", "velocity", "max_effort"), 0.0)
    if kind not in ("hinge", "slider"):
        raise InvalidInputError(f"a {kind} joint has no motor; a hinge or a slider may have one")
    if not isinstance(value, Motor):
        raise InvalidInputError(f"motor must be a Motor or None, got {type(value).__name__}")
    free, effort = value.position is None, np.asarray(value.effort, dtype=float)
    damping = (math.inf if free else 0.0) if value.damping is None else value.damping
    position, velocity = 0.0 if free else value.position, value.velocity
    if effort.any():
        # what the gains make of a wish so much further
        if free:
            damping = np.maximum(SLACK, 0.0 if value.damping is None else value.damping)
            velocity = velocity + effort / damping
        else:
            position = position + effort / value.stiffness
    return {
        "stiffness": value.stiffness, "damping": damping, "position": position, "velocity": velocity,
        "max_effort": value.max_effort,
    }  # fmt: skip


def motor_table(
    positions: Any, velocities: Any, stiffness: Any, damping: Any, max_effort: Any, effort: Any
) -> dict[str, np.ndarray]:
    """Return the numbers of many motors that go to positions, (joints,) or (worlds, joints) each; see `Motor`.

    Raises:
        InvalidInputError: a value that no motor can have.
    """
    given = {"position": positions, "velocity": velocities, "stiffness": stiffness, "effort": effort}
    made = {name: _checked(name, values, shapes=OF_MANY) for name, values in given.items()}
    made["damping"] = _checked("damping", damping, low=0.0, shapes=OF_MANY)
    most = np.asarray(max_effort, dtype=float)
    if not (most >= 0.0).all():
        raise InvalidInputError(f"max_effort must be at least 0, got {most.min():g}")
    if not (made["stiffness"] > 0.0).all():
        raise InvalidInputError("a motor that goes to a position needs a stiffness")
    # what the gains make of a wish so much further
    position = made["position"] + made.pop("effort") / made["stiffness"]
    return {**made, "position": position, "max_effort": most}


def spring_drives(kind: str, value: Spring | None) -> dict[str, Any]:
    """Return the numbers of a spring, or of none.

    Raises:
        InvalidInputError: no spring, or a joint that has none.
    """
    if value is None:
        return dict.fromkeys(("spring", "rest", "spring_damping"), 0.0)
    if kind == "fixed":
        raise InvalidInputError("a fixed joint has no spring")
    if not isinstance(value, Spring):
        raise InvalidInputError(f"spring must be a Spring or None, got {type(value).__name__}")
    if kind == "ball" and np.any(value.rest):
        raise InvalidInputError("a ball joint's spring rests where the joint was made: rest must be 0")
    return {"spring": value.stiffness, "rest": value.rest, "spring_damping": value.damping}
