"""Rigid solvers and bodies in a line each, for tests."""

import numpy as np

from nuno.rigid.convex_parts import rigid_shape
from nuno.shapes.mass_properties import mass_properties
from nuno.shapes.quaternion import from_axis_angle
from nuno.shapes.shape import Plane
from nuno.solvers.rigid_solver import RigidSolver

GRAVITY = 9.81


def on_floor(worlds=1, *, friction=0.5, slope=0.0, **settings):
    """Return a solver with an endless floor; a slope [rad] turns gravity instead of the floor, down along x."""
    settings.setdefault("gravity", (GRAVITY * np.sin(slope), 0.0, -GRAVITY * np.cos(slope)))
    solver = RigidSolver(worlds, **settings)
    put(solver, Plane(), friction=friction)
    return solver


def put(solver, shape, position=(0.0, 0.0, 0.0), quaternion=(1.0, 0.0, 0.0, 0.0), **more):
    """Add a static shape and return its slot."""
    return solver.add(rigid_shape(shape, moves=False), position=position, quaternion=quaternion, **more)


def drop(solver, shape, position, quaternion=(1.0, 0.0, 0.0, 0.0), *, density=1000.0, **more):
    """Add a dynamic shape, its centre of mass at a position, and return its slot."""
    weighed = mass_properties(shape)
    return solver.add(
        rigid_shape(shape), position=position, quaternion=quaternion, mass=density * weighed.volume,
        inertia=density * weighed.inertia, centre=weighed.centre, **more,
    )  # fmt: skip


def about(axis, degrees):
    """Return the quaternion of a turn about an axis."""
    axis = np.asarray(axis, dtype=float)
    return from_axis_angle(axis / np.linalg.norm(axis), np.radians(degrees))


def places(solver, slots):
    """Return the centres of mass in the first world (bodies, 3) [m]."""
    return np.array([solver.pose(slot)[0][0] for slot in slots])
