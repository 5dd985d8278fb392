"""A soft cube dropped on a floor: how fast, in one world and in many, and whether it settles as elasticity says.

    python benchmarks/softcube.py --worlds 1 16 --json out.json
    python benchmarks/softcube.py --device cuda:0 --worlds 1 1024 4096
    python benchmarks/softcube.py --peer newton=/nt/bin/python --peer mujoco=/mj/bin/python

0.2 m, 10 x 10 x 10 cells, 5,000 tetrahedra, E = 5e4 Pa, nu = 0.3, 1000 kg/m3, dropped from 0.3 m, 2 s. Compression is
the edge's length less the distance of the top face's mean from the base's, at the end; linear elasticity on a smooth
floor says rho g h^2 / (2 E) = 3.92 mm and a volume of 1 - (1 - 2 nu) rho g h / (2 E) = 0.992. A floor that grips
(friction 0.5) costs the lowest layer some of its widening, so both are run. Speeds are of all worlds together, medians
of the repeats, the solver by itself. Up to 16 worlds are one core's work; the speed by the core's busy time stands
beside, for machines that others use too. A peer is run by the Python of an environment that has it.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time

import numpy as np

SECONDS, REPEATS = 2.0, 3
EDGE, HEIGHT, DENSITY, YOUNG, POISSON, DAMPING = 0.2, 0.3, 1000.0, 5e4, 0.3, 0.005
GRAVITY = 9.81


def figures(rest: np.ndarray, x: np.ndarray, tets: np.ndarray) -> dict:
    """How much nearer than at rest top and base are [mm], the volume over that at rest, and elements inside out."""

    def volumes(v: np.ndarray) -> np.ndarray:
        a, b, c, d = (v[tets[:, k]] for k in range(4))
        return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0

    top = rest[:, 2] > rest[:, 2].max() - 1e-6
    base = rest[:, 2] < rest[:, 2].min() + 1e-6
    before, after = volumes(rest), volumes(x)
    return {
        "compression_mm": 1e3 * float(EDGE - x[top, 2].mean() + x[base, 2].mean()),
        "volume_ratio": float(after.sum() / before.sum()),
        "inverted": int((after * np.sign(before) <= 0).sum()),
    }


def cube(cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) [m] with the base at `HEIGHT`, and tetrahedra."""
    from nuno.mesh.tetrahedra import box_tetrahedra

    vertices, tets = box_tetrahedra((EDGE, EDGE, EDGE), (cells, cells, cells))
    vertices[:, 2] += EDGE / 2 + HEIGHT
    return vertices, tets


def run_nuno(given: argparse.Namespace, worlds: int, substeps: int | None, friction: float) -> dict:
    import warp as wp

    import nuno
    from nuno.solvers.soft_solver import SoftSolver
    from nuno.tables.colliders import Colliders
    from nuno.topology.soft_topology import SoftTopology

    wp.config.log_level = wp.LOG_WARNING
    vertices, tets = cube(given.cells)
    topology = SoftTopology.of(vertices, tets)
    material = nuno.Soft(
        density=DENSITY, youngs_modulus=YOUNG, poisson_ratio=POISSON, damping=DAMPING, friction=friction
    )
    start = np.repeat(vertices[None], worlds, axis=0)
    still = np.zeros_like(start)
    solver = SoftSolver(topology, material, start, still, device=given.device, substeps=substeps)
    floor = nuno.plane(friction=friction)
    solver.set_colliders(Colliders.from_bodies([floor], worlds, given.device))
    solver.run(0.0, 1.0 / 60.0)  # compiles
    spent, busy = [], []
    for _ in range(given.repeats):
        solver.set_state(start, still)
        wp.synchronize_device(given.device)
        begin, worked = time.perf_counter(), time.process_time()
        solver.run(0.0, SECONDS)
        wp.synchronize_device(given.device)
        spent.append(time.perf_counter() - begin)
        busy.append(time.process_time() - worked)
    return {
        "engine": "nuno", "device": given.device, "worlds": worlds, "cells": given.cells, "substeps": solver.substeps,
        "friction": friction, "wall_s": spent, "real_time": worlds * SECONDS / float(np.median(spent)),
        "real_time_of_core": worlds * SECONDS / float(np.median(busy)),
        "bytes_a_world": solver.memory_bytes / worlds,
        "fastest_vertex": float(np.abs(solver.velocities()[-1]).max()),
        **figures(vertices, solver.positions()[-1], tets),
    }  # fmt: skip


def run_newton(cells: int, device: str, repeats: int) -> dict:
    """Newton's VBD, 10 substeps of 10 iterations a frame, as in its example of hanging soft bodies."""
    import newton
    import warp as wp

    wp.config.log_level = wp.LOG_WARNING
    wp.set_device(device)
    vertices, tets = cube(cells)
    mu, lame = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, -GRAVITY))
    builder.add_soft_mesh(
        pos=wp.vec3(0, 0, 0), rot=wp.quat_identity(), scale=1.0, vel=wp.vec3(0, 0, 0),
        vertices=[wp.vec3(*p) for p in vertices], indices=tets.ravel().tolist(), density=DENSITY, k_mu=mu,
        k_lambda=lame, k_damp=1e-3 * mu, particle_radius=0.25 * EDGE / cells,
    )  # fmt: skip
    builder.color()
    builder.add_ground_plane()
    model = builder.finalize()
    model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_mu = 1e4, 1e-3, 0.5
    solver = newton.solvers.SolverVBD(model, iterations=10, particle_enable_self_contact=False)
    spent, dt = [], 1.0 / 60.0 / 10
    for repeat in range(repeats + 1):
        now, after, control = model.state(), model.state(), model.control()
        begin = time.perf_counter()
        for step in range(round(SECONDS * 60) * 10 if repeat else 10):
            if step % 10 == 0:
                contacts = model.collide(now)
            now.clear_forces()
            solver.step(now, after, control, contacts, dt)
            now, after = after, now
        wp.synchronize_device(device)
        spent.append(time.perf_counter() - begin)
    x = now.particle_q.numpy().astype(float)
    return peer_row(f"newton vbd {newton.__version__}", device, cells, spent[1:], vertices, x, tets)


def run_mujoco(cells: int, device: str, repeats: int) -> dict:
    """MuJoCo's flex with its own grid of tetrahedra and its discrete integrator, on the CPU whatever the device is."""
    import mujoco

    n, h, dt = cells + 1, EDGE / cells, 0.002
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{dt}" integrator="discrete" solver="CG" tolerance="1e-6"/>
        <worldbody><geom type="plane" size="5 5 .1" friction="0.5"/>
        <flexcomp name="c" type="grid" dim="3" count="{n} {n} {n}" spacing="{h} {h} {h}"
        pos="0 0 {HEIGHT + EDGE / 2}" mass="{DENSITY * EDGE**3}" radius="{h / 4}">
        <contact selfcollide="none" friction="0.5"/>
        <elasticity young="{YOUNG}" poisson="{POISSON}" damping="0.002"/></flexcomp></worldbody></mujoco>"""
    )
    data, spent = mujoco.MjData(model), []
    mujoco.mj_forward(model, data)
    rest, tets = data.flexvert_xpos.copy(), model.flex_elem.reshape(-1, 4)
    for _ in range(repeats):
        mujoco.mj_resetData(model, data)
        begin = time.perf_counter()
        for _ in range(round(SECONDS / dt)):
            mujoco.mj_step(model, data)
        spent.append(time.perf_counter() - begin)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_flex(model, data)
    return peer_row(f"mujoco flex {mujoco.__version__}", "cpu", cells, spent, rest, data.flexvert_xpos, tets)


def peer_row(engine, device, cells, spent, rest, x, tets) -> dict:
    row = {"engine": engine, "device": device, "worlds": 1, "cells": cells, "friction": 0.5, "wall_s": spent}
    return row | {"real_time": SECONDS / float(np.median(spent))} | figures(rest, x, tets)


PEERS = {"newton": run_newton, "mujoco": run_mujoco}


def run_peer(name: str, python: str, given: argparse.Namespace) -> dict:
    """Run this file's function for a peer in the peer's own environment."""
    command = [python, __file__, "--only", name, "--cells", str(given.cells), "--device", given.device]
    try:
        done = subprocess.run(
            [*command, "--repeats", str(given.repeats)], capture_output=True, text=True, check=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path[1:])},
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError) as error:
        last = (getattr(error, "stderr", "") or str(error)).strip().splitlines()[-1:]
        return {"engine": name, "error": " ".join(last)}
    return json.loads(done.stdout.splitlines()[-1])


def show(rows: list[dict]) -> None:
    print(f"{'engine':22} device  worlds substeps friction  x real time (of busy core)  compression  volume   inverted")
    for row in rows:
        if "error" in row:
            print(f"{row['engine']:22} {row['error']}")
            continue
        line = f"{row['engine']:22} {row['device']:7} {row['worlds']:6} {row.get('substeps', ''):>8}"
        line += f" {row['friction']:8.1f}  {row['real_time']:11.2f} {row.get('real_time_of_core', float('nan')):14.2f}"
        print(f"{line}  {row['compression_mm']:8.2f} mm  {row['volume_ratio']:.4f}  {row['inverted']:6}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--worlds", type=int, nargs="+", default=[1, 16])
    parser.add_argument("--substeps", type=int, nargs="+", default=[], help="besides the default")
    parser.add_argument("--friction", type=float, nargs="+", default=[0.0, 0.5])
    parser.add_argument("--cells", type=int, default=10)
    parser.add_argument("--repeats", type=int, default=REPEATS)
    parser.add_argument("--peer", action="append", default=[], metavar="NAME=PYTHON", help=" or ".join(PEERS))
    parser.add_argument("--json", help="write the figures there")
    parser.add_argument("--only", choices=PEERS, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.only:
        print(json.dumps(PEERS[given.only](given.cells, given.device, given.repeats)))
        return
    peers = dict(each.split("=", 1) for each in given.peer)
    if unknown := set(peers) - set(PEERS):
        sys.exit(f"no such peer: {', '.join(sorted(unknown))}; there are {', '.join(PEERS)}")
    rows = []
    for worlds in given.worlds:
        for substeps in (None, *given.substeps):
            for friction in given.friction:
                rows.append(run_nuno(given, worlds, substeps, friction))
    rows += [run_peer(name, python, given) for name, python in peers.items()]
    show(rows)
    if given.json:
        with open(given.json, "w", encoding="utf-8") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
