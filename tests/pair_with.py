"""What tests of two bodies ask of a world: momentum, spin, energy and mass of everything that moves."""

from __future__ import annotations

from typing import Any

import numpy as np

import nuno
from nuno.shapes import quaternion as quat

GRAVITY = 9.81  # [m/s2], the default of World


def mass_of(body: nuno.Body) -> float:
    """Return the mass [kg] of a dynamic body in the first world."""
    dynamics: Any = body._dynamics
    return float(dynamics.mass[0] if dynamics.is_rigid else dynamics.solver.mass[0].sum())


def moment(body: nuno.Body) -> tuple[np.ndarray, np.ndarray, float]:
    """Return momentum (3,) [kg m/s], angular momentum (3,) [kg m2/s] about the origin, and kinetic energy [J]."""
    dynamics: Any = body._dynamics
    if dynamics.is_rigid:
        solver, slot = dynamics.solver, dynamics.slot
        (place, turn), (velocity, spin) = solver.pose(slot), solver.velocity(slot)
        turned = quat.rotate(turn[0], np.eye(3)).T  # columns are the body's axes
        inertia = turned @ dynamics.inertia[0] @ turned.T
        mass = dynamics.mass[0]
        own = inertia @ spin[0]
        linear = mass * velocity[0]
        energy = 0.5 * (mass * velocity[0] @ velocity[0] + spin[0] @ own)
        return linear, np.cross(place[0], linear) + own, float(energy)
    mass, x, v = dynamics.solver.mass[0], dynamics.solver.positions()[0], dynamics.solver.velocities()[0]
    energy = 0.5 * float(mass @ (v * v).sum(axis=1))
    return mass @ v, np.einsum("n,nx->x", mass, np.cross(x, v)), energy


def moments(*bodies: nuno.Body) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the sums of ``moment`` over bodies."""
    each = [moment(body) for body in bodies]
    return sum(m[0] for m in each), sum(m[1] for m in each), sum(m[2] for m in each)


def volume(body: nuno.Body) -> float:
    """Return the volume [m3] inside a closed surface."""
    corners = body.vertices[body.faces]
    return float(np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0)


def mean_load(world: nuno.World, grips: list[nuno.Grip], seconds: float) -> np.ndarray:
    """Return the mean force (3,) [N] that grips bear together over a time."""
    frames = round(seconds * world.frame_rate)
    total = np.zeros(3)
    for _ in range(frames):
        world.step()
        total += sum(grip.wrench[0] for grip in grips)
    return total / frames
