"""Picks simulated with MuJoCo's flexible bodies, where that package is installed: ``pip install mujoco``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from tqdm import tqdm

from nuno.estimate.futures import is_turned, table_world

CELLS = 20  # along the longer side
STEP = 0.003  # [s]
MEMBRANE = 3000.0  # [N/m] stiffness in the plane, Young's modulus times thickness
POISSON = 0.3
RADIUS = 0.0025  # [m] of collision: half of what keeps two layers apart
LIFT_SECONDS = 1.5
REST = 0.1  # [s] before the lift


def model_of(scene: Any, pick: Any, cells: tuple[int, int], membrane: float = MEMBRANE, radius: float = RADIUS) -> str:
    """The model's XML: a table, a cloth of triangles that bend and stretch, and a hand that leads one of its points.

    A plate of thickness t and Young's modulus E has the bending rigidity E t^3 / 12 (1 - nu^2).
    """
    rectangle, table, material = scene.rectangle, scene.table, pick.material
    thickness = float(np.sqrt(12.0 * material["bending_rigidity"] * (1.0 - POISSON**2) / membrane))
    spacing = np.array([rectangle.long_m, rectangle.short_m]) / cells
    x, y, z = rectangle.centre
    half = (*table.half_extents, table.thickness / 2)
    mass = material["area_density"] * rectangle.long_m * rectangle.short_m
    friction = material["friction"]
    hand = pick.path[0]
    return f"""<mujoco>
<option timestep="{STEP}" integrator="discrete" solver="CG" tolerance="1e-6" iterations="100"/>
<worldbody>
<geom type="box" size="{half[0]} {half[1]} {half[2]}" pos="{table.centre[0]} {table.centre[1]} {table.height - half[2]}"
 friction="{friction}"/>
<geom type="plane" size="3 3 .1"/>
<body name="hand" mocap="true" pos="{hand[0]} {hand[1]} {hand[2]}"/>
<flexcomp name="cloth" type="grid" dim="2" count="{cells[0] + 1} {cells[1] + 1} 1"
 spacing="{spacing[0]} {spacing[1]} {spacing.min()}" pos="{x} {y} {z}" euler="0 0 {np.degrees(rectangle.yaw)}"
 mass="{mass}" radius="{radius}">
<contact selfcollide="auto" friction="{friction}" solref="0.01 1"/>
<elasticity young="{membrane / thickness}" poisson="{POISSON}" thickness="{thickness}" damping="0.002"
 elastic2d="both"/>
</flexcomp>
</worldbody>
</mujoco>"""


def simulate(
    scene: Any, picks: Sequence[Any], hold: float, device: str, *, cells_along: int = CELLS, **cloth: float
) -> tuple[np.ndarray, np.ndarray, Any]:
    """Pick one cloth in as many ways as there are picks; arguments and answer as those of `nuno_picks.simulate`.

    ``cells_along`` its longer side it has, and ``cloth`` are further arguments of `model_of`.
    """
    rectangle = scene.rectangle
    across = 5 * max(3, round(cells_along * rectangle.short_m / rectangle.long_m / 5))
    cells = (cells_along, across)
    # Nuno's own sheet tells where each of its vertices lies, in which order they are drawn
    before = np.asarray(table_world(rectangle, scene.table, cells, device=device, substeps=1)[1].vertices)
    after = [_picked(scene, pick, before, cells, hold, cloth) for pick in tqdm(picks, disable=None, desc="MuJoCo")]
    return before, np.stack(after), cells


def _picked(
    scene: Any, pick: Any, before: np.ndarray, cells: tuple[int, int], hold: float, cloth: dict[str, float]
) -> np.ndarray:
    """Vertices (n, 3) [m] once the cloth hangs."""
    import mujoco

    spec = mujoco.MjSpec.from_string(model_of(scene, pick, cells, **cloth))
    i, j = pick.ij
    row = j * cells[1] // 5
    row = cells[1] - row if is_turned(scene.rectangle) else row
    held = before[row * (cells[0] + 1) + i * cells[0] // 5]
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    places = data.flexvert_xpos.copy()
    order = np.linalg.norm(before[:, None] - places[None], axis=2).argmin(axis=1)
    assert np.abs(places[order] - before).max() < 1e-3
    body = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, int(model.flex_vertbodyid[order[_at(before, held)]]))
    tie = spec.add_equality()
    tie.type, tie.objtype = mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtObj.mjOBJ_BODY
    tie.name1, tie.name2, tie.solref = body, "hand", (0.008, 1.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    mass = model.dof_M0.copy()
    for step in range(round((REST + LIFT_SECONDS + hold) / STEP)):
        share = np.clip((step * STEP - REST) / LIFT_SECONDS, 0.0, 1.0) * (len(pick.path) - 1)
        at = min(int(share), len(pick.path) - 2)
        data.mocap_pos[0] = pick.path[at] + (share - at) * (pick.path[at + 1] - pick.path[at])
        data.qfrc_applied[:] = -pick.material["air_drag"] * mass * data.qvel
        mujoco.mj_step(model, data)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_flex(model, data)
    return data.flexvert_xpos[order].copy()


def _at(points: np.ndarray, place: np.ndarray) -> int:
    return int(np.linalg.norm(points - place, axis=1).argmin())
