"""A garment that hangs from one vertex, simulated by MuJoCo's flex: not Nuno's engine, for cases that judge Nuno."""

from __future__ import annotations

from typing import Any

import numpy as np

from nuno import Garment
from nuno.estimate.imagined_holds import begin

SECONDS = 3.5
STEP = 0.002
"""[s]"""
XML = """
<mujoco>
  <option timestep="{step}" solver="CG" tolerance="1e-6" iterations="60" integrator="discrete" gravity="0 0 -9.81"/>
  <size memory="200M"/>
  <worldbody>
    <flexcomp name="garment" type="direct" dim="2" mass="{mass}" radius="{radius}" point="{points}" element="{faces}">
      <edge equality="true"/>
      <elasticity young="{young}" poisson="0.2" thickness="{thickness}" elastic2d="bend"/>
      <contact selfcollide="auto" condim="3" friction="0.4" solref="0.01 1"/>
      <pin id="{pin}"/>
    </flexcomp>
  </worldbody>
</mujoco>
"""


def hang(garment: Garment, vertex: int, rng: np.random.Generator) -> np.ndarray:
    """Return (n, 3) where a garment's vertices are [m] from the held one, after it fell from lying flat.

    Args:
        garment: The garment.
        vertex: The held one.
        rng: Of the material.
    """
    import mujoco

    start = begin(garment, vertex, False)
    rigidity, thickness = float(np.exp(rng.uniform(np.log(2e-5), np.log(2e-4)))), 1e-3
    text = XML.format(
        step=STEP, mass=garment.area * rng.uniform(0.12, 0.3), radius=0.0012,
        young=12.0 * rigidity * (1.0 - 0.2**2) / thickness**3, thickness=thickness, pin=vertex,
        points=" ".join(f"{x:.6f}" for x in start.ravel()), faces=" ".join(str(k) for k in garment.faces.ravel()),
    )  # fmt: skip
    model: Any = mujoco.MjModel.from_xml_string(text)
    model.dof_damping[:] = 2.0 * model.body_mass[model.dof_bodyid]  # air: 2 / s
    data: Any = mujoco.MjData(model)
    while data.time < SECONDS:
        mujoco.mj_step(model, data)
    found = np.array(data.flexvert_xpos).reshape(-1, 3)
    return found - found[vertex]
