"""Memory: what a batch of worlds needs, and whether there is as much."""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from nuno.dynamics.dynamics import ParticleDynamics
from nuno.errors import NotEnoughMemoryError
from nuno.mesh.memory_limit import free_bytes
from nuno.solvers.array_memory import HOST_COPIES, array_bytes

if TYPE_CHECKING:
    from nuno.world.simulation import Simulation

MEASURED = 16
"""Worlds of the batch that is made to see what a world of one takes."""


def check_memory(world: Simulation, worlds: int, device: str, few: Callable[[int], Simulation]) -> None:
    """Check that there is memory for a batch of copies of a world; ``few`` makes a batch of so many of them.

    Raises:
        NotEnoughMemoryError: it needs more than is free.
    """
    each, host = world_bytes(world)
    free = free_bytes(device)
    if worlds > MEASURED and worlds * (each + host) > free:
        # a single world may have room for more than one of a batch has: a few are made to see
        each, host = world_bytes(few(MEASURED))
    needed = worlds * (each + host) if device == "cpu" else worlds * each
    if needed > free:
        gc.collect()  # of worlds that nobody refers to any more
        free = free_bytes(device)
    if needed > free:
        most = int(free // max(needed / worlds, 1))
        raise NotEnoughMemoryError(f"{worlds} worlds", needed, free, f"{most} worlds fit")
    if device != "cpu" and worlds * host > free_bytes("cpu"):
        raise NotEnoughMemoryError(f"{worlds} worlds", worlds * host, free_bytes("cpu"), "that is of the host")


def world_bytes(world: Simulation) -> tuple[int, int]:
    """Return what one world's dynamics take on the device, and what making a copy of it takes on the host [bytes]."""
    device = host = 0
    for dynamics in world._attached():
        if isinstance(dynamics, ParticleDynamics):
            own, copied = dynamics.solver.world_bytes()
            device, host = device + own, host + copied
    if world._rigid is not None:
        rigid: Any = world._rigid.solver
        device += sum(array_bytes(holder) for holder in (rigid.state, rigid.manifolds)) // rigid.world_count
    for body in world._bodies.values():
        if body._deformed is not None:
            host += HOST_COPIES * body._deformed[0][0].nbytes
    return device, host
