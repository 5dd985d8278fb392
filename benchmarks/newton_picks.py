"""Picks simulated with Newton's VBD, where that package is installed: ``pip install newton``. A GPU's work."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from generated_cases import REST_HEIGHT
from tqdm import tqdm

from nuno.estimate.futures import is_turned, table_world

CELLS = 20  # along the longer side
RATE = 60  # frames a second
SUBSTEPS, ITERATIONS = 10, 10
STRETCH = 1000.0  # [N/m] stiffness of a triangle
BEND_DAMPING = 1e-4
APART = 4.0  # [m] between the scenes of picks, so that cloths of different picks never meet
COLUMNS = 4  # of scenes
LIFT_SECONDS = 1.5
REST = 0.1  # [s] before the lift


@wp.kernel
def lead_hands(
    time: wp.array[int],
    held: wp.array[int],
    ways: wp.array2d[wp.vec3],
    places: wp.array[wp.vec3],
    velocities: wp.array[wp.vec3],
):
    """Put the held particle of each pick where its hand is after this substep."""
    pick = wp.tid()
    places[held[pick]] = ways[wp.min(time[0] + 1, ways.shape[0] - 1), pick]
    velocities[held[pick]] = wp.vec3(0.0)


@wp.kernel
def drag(
    rates: wp.array[float],
    masses: wp.array[float],
    velocities: wp.array[wp.vec3],
    time: wp.array[int],
    forces: wp.array[wp.vec3],
):
    """Slow each particle down by the air, at its cloth's rate [1/s]; count the substep."""
    k = wp.tid()
    forces[k] = -rates[k] * masses[k] * velocities[k]
    if k == 0:
        time[0] = time[0] + 1


def simulate(scene: Any, picks: Sequence[Any], hold: float, device: str) -> tuple[np.ndarray, np.ndarray, Any]:
    """Pick one cloth in as many ways as there are picks; arguments and answer as those of `nuno_picks.simulate`.

    All picks are one model, each with a table of its own. The friction between layers is the mean of all cloths', that
    with the table the cloth's own.
    """
    rectangle, count = scene.rectangle, len(picks)
    across = 5 * max(3, round(CELLS * rectangle.short_m / rectangle.long_m / 5))
    cells = (CELLS, across)
    # Nuno's own sheet tells where each of its vertices lies, in which order they are drawn
    cloth = table_world(rectangle, scene.table, cells, device="cpu", substeps=1)[1]
    before, faces = np.asarray(cloth.vertices), np.asarray(cloth.faces)
    shifts = np.array([(APART * (k % COLUMNS), APART * (k // COLUMNS), 0.0) for k in range(count)])
    ij = np.array([pick.ij for pick in picks])
    row = ij[:, 1] * across // 5
    row = across - row if is_turned(rectangle) else row
    held = np.arange(count) * len(before) + row * (cells[0] + 1) + ij[:, 0] * cells[0] // 5
    if wp.get_cuda_device_count() and device == "cpu":
        device = "cuda:0"  # a core takes minutes for what a GPU does in seconds
    with wp.ScopedDevice(device):
        model = _model(scene, picks, before, faces, shifts, rectangle.long_m / CELLS)
        after = _picked(model, picks, held, len(before), shifts, hold)
    if not np.isfinite(after).all():
        raise RuntimeError("Newton's cloth diverged")
    return before, after, cells


def _model(scene: Any, picks: Sequence[Any], before: np.ndarray, faces: np.ndarray, shifts: Any, cell: float) -> Any:
    """A table and a cloth for each pick, and the floor.

    Bent about a line by a curvature c, a cell of side h turns by c h, which costs k h (c h)^2 / 2 of a crease's
    stiffness k, and B (c h)^2 / 2 of a plate's rigidity B: so k is about B / h.
    """
    import newton

    friction = float(np.mean([pick.material["friction"] for pick in picks]))
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, -9.81))
    table = scene.table
    for pick, shift in zip(picks, shifts, strict=True):
        material = pick.material
        builder.add_cloth_mesh(
            pos=wp.vec3(*shift), rot=wp.quat_identity(), scale=1.0, vel=wp.vec3(0.0),
            vertices=[wp.vec3(*place) for place in before], indices=faces.ravel().tolist(),
            density=material["area_density"], particle_radius=REST_HEIGHT, tri_ke=STRETCH, tri_ka=STRETCH, tri_kd=1e-2,
            edge_ke=material["bending_rigidity"] / cell, edge_kd=BEND_DAMPING,
        )  # fmt: skip
        # contact takes the geometric mean of a shape's friction and the cloths'
        look = newton.ModelBuilder.ShapeConfig(mu=material["friction"] ** 2 / friction)
        place = (*(np.asarray(table.centre) + shift[:2]), table.height - table.thickness / 2)
        half = dict(zip(("hx", "hy", "hz"), (*table.half_extents, table.thickness / 2), strict=True))
        builder.add_shape_box(-1, xform=wp.transform(place, wp.quat_identity()), cfg=look, **half)
    builder.color(include_bending=True)
    builder.add_ground_plane()
    model = builder.finalize()
    model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_mu = 1e3, 1e-3, friction
    return model


def _picked(model: Any, picks: Sequence[Any], held: np.ndarray, size: int, shifts: np.ndarray, hold: float) -> Any:
    """Vertices (picks, n, 3) [m] once the cloths hang."""
    import newton

    flags = model.particle_flags.numpy()
    flags[held] &= ~int(newton.ParticleFlags.ACTIVE)
    model.particle_flags.assign(flags)
    step, cell = 1.0 / RATE / SUBSTEPS, 4.0 * REST_HEIGHT
    solver = newton.solvers.SolverVBD(
        model, iterations=ITERATIONS, particle_enable_self_contact=True, particle_self_contact_margin=0.5 * cell,
        particle_self_contact_gap=0.25 * cell,
    )  # fmt: skip
    frames = round((REST + LIFT_SECONDS + hold) * RATE)
    times = np.clip((np.arange(frames * SUBSTEPS + 2) * step - REST) / LIFT_SECONDS, 0.0, 1.0)
    ways = np.stack([_along(pick.path, times) for pick in picks], axis=1) + shifts
    ways += model.particle_q.numpy()[held] - ways[0]  # a hand holds a vertex, which is close to the point
    hands, led = wp.array(ways, dtype=wp.vec3), wp.array(held, dtype=int)
    rates = wp.array(np.repeat([pick.material["air_drag"] for pick in picks], size), dtype=float)
    time, states, control = wp.zeros(1, dtype=int), [model.state(), model.state()], model.control()
    pipeline = newton.CollisionPipeline(model)
    contacts = pipeline.contacts()

    def frame() -> None:
        for _ in range(SUBSTEPS):
            now, then = states
            wp.launch(lead_hands, len(held), [time, led, hands, now.particle_q, now.particle_qd])
            wp.launch(drag, len(rates), [rates, model.particle_mass, now.particle_qd, time, now.particle_f])
            pipeline.collide(now, contacts)
            solver.step(now, then, control, contacts, step)
            states.reverse()

    frame()  # loads kernels; a pair of states is back in its order after an even number of substeps
    graph = None
    if model.device.is_cuda:
        with wp.ScopedCapture() as captured:
            frame()
        graph = captured.graph
    for _ in tqdm(range(frames - 1), disable=None, desc="Newton"):
        if graph is None:
            frame()
        else:
            wp.capture_launch(graph)
    return states[0].particle_q.numpy().reshape(len(picks), size, 3).astype(float) - shifts[:, None]


def _along(path: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Places (k, 3) [m] at shares of a path of even times."""
    at = shares * (len(path) - 1)
    return np.stack([np.interp(at, np.arange(len(path)), path[:, axis]) for axis in range(3)], axis=1)
