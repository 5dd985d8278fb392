"""A sheet hung by two corners: how fast, how much it stretches, and how near it comes to a converged run.

    python benchmarks/hang.py --json out.json
    python benchmarks/hang.py --cells 16 32 64 --peer mujoco=/mj/bin/python --peer newton=/nt/bin/python

1 m x 1 m, 0.2 kg/m2, 1000 N/m, pinned at two adjacent corners, let go from horizontal, 2 s. Strain is over all edges
of the triangulated grid; the distance is to the same cloth at ``REFERENCE`` substeps, and beside it stands how far
two such references, of `REFERENCE` and of half as many substeps, are from each other: a swinging cloth is chaotic, and
no run can be asked to be nearer than that. A peer is run by the Python of an environment that has it; its own
stiffness stands in its settings, and its shape is not compared.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time

import numpy as np

SECONDS, REPEATS, REFERENCE = 2.0, 3, 640
DENSITY, STIFFNESS, HEIGHT = 0.2, 1000.0, 2.0


def grid(cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices ((cells + 1)^2, 3) [m], index j (cells + 1) + i, and triangles."""
    t = np.linspace(-0.5, 0.5, cells + 1)
    x, y = np.meshgrid(t, t)
    j, i = np.mgrid[:cells, :cells]
    a = (j * (cells + 1) + i).ravel()
    b, c, d = a + 1, a + cells + 1, a + cells + 2
    faces = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, HEIGHT)], 1), faces


def strains(rest: np.ndarray, x: np.ndarray, faces: np.ndarray) -> dict:
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    length = [np.linalg.norm(v[edges[:, 0]] - v[edges[:, 1]], axis=1) for v in (rest, x)]
    strain = 100 * (length[1] / length[0] - 1)
    return {"p99_strain_percent": float(np.percentile(strain, 99)), "max_strain_percent": float(strain.max())}


def nuno_run(cells: int, substeps: int | None, repeats: int, self_contact: bool) -> tuple[np.ndarray, list[float], int]:
    """Positions at the end, seconds of each repeat, and the substeps; the solver by itself, on one core."""
    import warp as wp

    from nuno import Cloth
    from nuno.solvers.cloth_solver import ClothSolver
    from nuno.topology.cloth_topology import ClothTopology

    wp.config.log_level = wp.LOG_WARNING
    sheet = ClothTopology.sheet((cells, cells), (1.0, 1.0))
    start = sheet.rest[None] + [0.0, 0.0, HEIGHT]
    material = Cloth(area_density=DENSITY, stretch_stiffness=STIFFNESS)
    still = np.zeros_like(start)
    solver = ClothSolver(sheet, material, start, still, substeps=substeps, self_contact=self_contact)
    solver.set_grips([Corners(start[:, [0, cells]], np.array([[0, cells]]))])
    solver.run(0.0, 1.0 / 60.0)  # compiles
    spent = []
    for _ in range(repeats):
        solver.set_state(start, still)
        begin = time.perf_counter()
        solver.run(0.0, SECONDS)
        spent.append(time.perf_counter() - begin)
    return solver.positions()[0], spent, solver.substeps


class Corners:
    """Two vertices that stay where they are: what a solver asks of a grip."""

    corners = barycentric = None
    times, interpolation, compliance = (0.0,), "linear", 0.0

    def __init__(self, places: np.ndarray, vertices: np.ndarray) -> None:
        self.positions, self.vertices = places[:, :, None], vertices


def run_nuno(cells: int, substeps: list[int | None], repeats: int) -> list[dict]:
    rest, faces = grid(cells)
    reference, half = (nuno_run(cells, n, 1, False)[0] for n in (REFERENCE, REFERENCE // 2))
    floor = np.linalg.norm(reference - half, axis=1)
    rows = []
    for wanted in substeps:
        for contact in (False, True):
            x, spent, used = nuno_run(cells, wanted, repeats, contact)
            away = np.linalg.norm(x - reference, axis=1)
            name = "nuno" + (", self-contact" if contact else "") + (", default" if wanted is None else "")
            rows.append(
                {
                    "engine": name, "cells": cells, "substeps": used, "wall_s": spent,
                    "real_time": SECONDS / float(np.median(spent)), **strains(rest, x, faces),
                    "mean_distance_mm": 1e3 * float(away.mean()), "max_distance_mm": 1e3 * float(away.max()),
                    "references_apart_mm": [1e3 * float(floor.mean()), 1e3 * float(floor.max())],
                }
            )  # fmt: skip
    return rows


def run_mujoco(cells: int, repeats: int) -> list[dict]:
    """MuJoCo's flex with its discrete integrator, after the tuning section of its own documentation."""
    import mujoco

    n, h, dt = cells + 1, 1.0 / cells, 0.004
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{dt}" integrator="discrete" solver="Newton" tolerance="1e-6" iterations="100"/>
        <worldbody><flexcomp name="c" type="grid" dim="2" count="{n} {n} 1" spacing="{h} {h} {h}" pos="0 0 {HEIGHT}"
        mass="{DENSITY}" radius="0.001"><pin id="0 {cells * n}"/>
        <contact selfcollide="none" contype="0" conaffinity="0"/>
        <elasticity young="1e6" poisson="0.2" thickness="1e-3" damping="0.002" elastic2d="both"/>
        </flexcomp></worldbody></mujoco>"""
    )
    data, spent = mujoco.MjData(model), []
    mujoco.mj_forward(model, data)
    rest, faces = data.flexvert_xpos.copy(), model.flex_elem.reshape(-1, 3)
    for _ in range(repeats):
        mujoco.mj_resetData(model, data)
        begin = time.perf_counter()
        for _ in range(round(SECONDS / dt)):
            mujoco.mj_step(model, data)
        spent.append(time.perf_counter() - begin)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_flex(model, data)
    return [peer_row("mujoco flex", mujoco.__version__, cells, spent, rest, data.flexvert_xpos, faces)]


def run_newton(cells: int, repeats: int) -> list[dict]:
    """Newton's XPBD, with as many substeps and as soft springs as keep it from exploding at 0.2 kg/m2."""
    import newton
    import warp as wp

    wp.config.log_level = wp.LOG_WARNING
    wp.set_device("cpu")
    rest, faces = grid(cells)
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, -9.81))
    builder.add_cloth_mesh(
        pos=wp.vec3(0, 0, 0), rot=wp.quat_identity(), scale=1.0, vel=wp.vec3(0, 0, 0),
        vertices=[wp.vec3(*p) for p in rest], indices=faces.ravel().tolist(), density=DENSITY,
        particle_radius=0.3 / cells, tri_ke=0.0, tri_ka=0.0, tri_kd=0.0, add_springs=True, spring_ke=300.0,
        spring_kd=1e-3, edge_ke=1e-4, edge_kd=0.0,
    )  # fmt: skip
    model = builder.finalize()
    flags = model.particle_flags.numpy()
    flags[[0, cells]] &= ~int(newton.ParticleFlags.ACTIVE)
    model.particle_flags = wp.array(flags, dtype=model.particle_flags.dtype, device=model.device)
    solver = newton.solvers.SolverXPBD(model, iterations=4)
    substeps, spent = 2 * cells, []
    dt = 1.0 / 60.0 / substeps
    for repeat in range(repeats + 1):
        now, after, control = model.state(), model.state(), model.control()
        begin = time.perf_counter()
        for _ in range(round(SECONDS * 60) * substeps if repeat else substeps):
            now.clear_forces()
            solver.step(now, after, control, None, dt)
            now, after = after, now
        spent.append(time.perf_counter() - begin)
    x = now.particle_q.numpy().astype(float)
    return [peer_row("newton xpbd", newton.__version__, cells, spent[1:], rest, x, faces)]


def peer_row(engine, version, cells, spent, rest, x, faces) -> dict:
    row = {"engine": f"{engine} {version}", "cells": cells, "real_time": SECONDS / float(np.median(spent))}
    return row | {"wall_s": spent} | strains(rest, x, faces)


PEERS = {"mujoco": run_mujoco, "newton": run_newton}


def run_peer(name: str, python: str, cells: int, repeats: int) -> list[dict]:
    """Run this file's function for a peer in the peer's own environment."""
    command = [python, __file__, "--only", name, "--cells", str(cells), "--repeats", str(repeats)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        last = (getattr(error, "stderr", "") or str(error)).strip().splitlines()[-1:]
        return [{"engine": name, "cells": cells, "error": " ".join(last)}]
    return json.loads(done.stdout.splitlines()[-1])


def show(rows: list[dict]) -> None:
    print(f"{'engine':30} cells substeps  x real time  p99 %  max %  distance mm: mean, max (references apart)")
    for row in rows:
        if "error" in row:
            print(f"{row['engine']:30} {row['cells']:5}  {row['error']}")
            continue
        line = f"{row['engine']:30} {row['cells']:5} {row.get('substeps', ''):>8}  {row['real_time']:11.2f}"
        line += f"  {row['p99_strain_percent']:5.2f}  {row['max_strain_percent']:5.1f}"
        if "mean_distance_mm" in row:
            apart = row["references_apart_mm"]
            line += f"  {row['mean_distance_mm']:.1f}, {row['max_distance_mm']:.1f} ({apart[0]:.1f}, {apart[1]:.1f})"
        print(line)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, nargs="+", default=[32])
    parser.add_argument("--substeps", type=int, nargs="+", default=[20, 40], help="besides the default")
    parser.add_argument("--repeats", type=int, default=REPEATS)
    parser.add_argument("--peer", action="append", default=[], metavar="NAME=PYTHON", help=" or ".join(PEERS))
    parser.add_argument("--json", help="write the figures there")
    parser.add_argument("--only", choices=PEERS, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.only:
        print(json.dumps(PEERS[given.only](given.cells[0], given.repeats)))
        return
    peers = dict(each.split("=", 1) for each in given.peer)
    if unknown := set(peers) - set(PEERS):
        sys.exit(f"no such peer: {', '.join(sorted(unknown))}; there are {', '.join(PEERS)}")
    rows = []
    for cells in given.cells:
        rows += run_nuno(cells, [None, *given.substeps], given.repeats)
        for name, python in peers.items():
            rows += run_peer(name, python, cells, given.repeats)
    show(rows)
    if given.json:
        with open(given.json, "w", encoding="utf-8") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
