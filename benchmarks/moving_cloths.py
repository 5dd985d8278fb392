"""Cloths that hands fold, lift, drag and shake, as engines move them: vertices at 30 Hz, the truth of following.

Engines: "nuno" (another material, mesh and substep than a follower assumes), "mujoco" (flex) and "newton" (VBD), where
they are installed. Each motion is one or two hands on paths that are known; see ``benchmarks/following.py``. With a
seed, size, bending, mass, friction, hands and their paths, and how long those take, are drawn anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

SIZE = (0.4, 0.3)  # [m]
TOP = 0.7  # [m] the table
RATE = 30.0  # [1/s] of the truth
CELLS = {"nuno": (24, 18), "mujoco": (16, 12), "newton": (20, 15)}
RADIUS = {"nuno": 0.001, "mujoco": 0.002, "newton": 0.004}  # [m] height of the cloth's middle above the table at rest
MOTIONS = ("fold", "lift", "drag", "shake")
ENGINES = ("nuno", "mujoco", "newton")


@dataclass(frozen=True)
class Motion:
    """Hands: (hands, 2) where they hold the cloth as (u, v), and where they are then, (hands, k, 3) [m] from there.

    And the cloth's size [m], and bending rigidity and mass over those of an engine's own cloth, and friction.
    """

    held: np.ndarray
    times: np.ndarray
    moves: np.ndarray
    size: tuple[float, float] = SIZE
    stiffer: float = 1.0
    heavier: float = 1.0
    friction: float = 0.4

    def at(self, time: float) -> np.ndarray:
        """Return how far the hands are from where they began, (hands, 3) [m]."""
        return np.stack([[np.interp(time, self.times, way[:, k]) for k in range(3)] for way in self.moves])


def motion(name: str, seed: int | None = None) -> Motion:
    """Return one of the motions, 3.5 s long; with a seed, as it draws it."""
    return _usual(name) if seed is None else _drawn(name, np.random.default_rng([seed, MOTIONS.index(name)]))


def _drawn(name: str, rng: np.random.Generator) -> Motion:
    """Return a motion of another cloth by another edge or corner, by another way and in another time."""
    usual = _usual(name)
    size = (float(rng.uniform(0.28, 0.55)), float(rng.uniform(0.22, 0.42)))
    scale = np.array([size[0] / SIZE[0], size[1] / SIZE[1], 1.0]) * rng.uniform(0.75, 1.15, 3)
    speed = rng.uniform(0.85, 1.35)
    clock = np.minimum(speed * usual.times, usual.times[-1])
    moves = np.stack([usual.at(time) for time in clock], axis=1) * scale
    held = usual.held.copy()
    for axis in range(2):  # from the other side, towards this one
        if rng.random() < 0.5:
            held[:, axis], moves[..., axis] = 1.0 - held[:, axis], -moves[..., axis]
    return Motion(
        held, usual.times, moves, size, float(4.0 ** rng.uniform(-1.0, 1.0)), float(rng.uniform(0.6, 1.6)),
        float(rng.uniform(0.2, 0.7)),
    )  # fmt: skip


def _usual(name: str) -> Motion:
    times = np.linspace(0.0, 3.5, 211)
    s = np.clip((times - 0.3) / 2.2, 0.0, 1.0)
    s = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)  # minimum jerk
    zero = np.zeros_like(s)
    if name == "fold":  # two corners over to the other side
        way = np.stack([0.36 * s, zero, 0.17 * np.sin(np.pi * s) + 0.02 * s], axis=1)
        return Motion(np.array([[0.0, 0.0], [0.0, 1.0]]), times, np.stack([way, way]))
    if name == "lift":  # one corner up and inwards
        return Motion(np.array([[0.0, 0.0]]), times, np.stack([0.12 * s, 0.08 * s, 0.3 * s], axis=1)[None])
    if name == "drag":  # an edge along the table, and turned a little
        along = np.stack([-0.22 * s, zero, 0.05 * np.minimum(1.0, 6.0 * s)], axis=1)
        other = along + np.stack([zero, 0.06 * s, zero], axis=1)
        return Motion(np.array([[0.0, 0.0], [0.0, 1.0]]), times, np.stack([along, other]))
    up = np.clip((times - 0.2) / 1.3, 0.0, 1.0)
    up = up**3 * (10.0 - 15.0 * up + 6.0 * up * up)
    swing = 0.05 * np.sin(2.0 * np.pi * 1.2 * np.maximum(times - 1.5, 0.0))
    way = np.stack([0.1 * up + swing, zero, 0.42 * up], axis=1)
    return Motion(np.array([[0.0, 0.0], [0.0, 1.0]]), times, np.stack([way, way]))


def flat(cells: tuple[int, int], height: float, size: tuple[float, float]) -> np.ndarray:
    """Return the vertices (ny + 1, nx + 1, 3) [m] of a cloth flat on the table."""
    x, y = (np.linspace(-0.5 * s, 0.5 * s, n + 1) for s, n in zip(size, cells, strict=True))
    return np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), TOP + height)], axis=-1)


@lru_cache(maxsize=1)
def truth(engine: str, name: str, seed: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return times (k,) [s] and vertices (k, ny + 1, nx + 1, 3) [m] of a motion as an engine has it."""
    makers = {"nuno": _nuno, "mujoco": _mujoco, "newton": _newton}
    hands = motion(name, seed)
    times = np.arange(0.0, hands.times[-1] + 1e-9, 1.0 / RATE)
    return times, makers[engine](hands, times, CELLS[engine], RADIUS[engine])


def resampled(vertices: np.ndarray, cells: tuple[int, int]) -> np.ndarray:
    """Return vertices (..., (nx + 1) (ny + 1), 3) of another mesh on the same cloth, by rows along x; bilinear."""
    from scipy.ndimage import map_coordinates

    rows, columns = vertices.shape[-3:-1]
    v, u = np.meshgrid(np.linspace(0, rows - 1, cells[1] + 1), np.linspace(0, columns - 1, cells[0] + 1), indexing="ij")
    flat_ = vertices.reshape(-1, rows, columns, 3)
    places = [v.ravel(), u.ravel()]
    each = [[map_coordinates(f[..., k], places, order=1) for k in range(3)] for f in flat_]
    found = np.moveaxis(np.array(each), 1, -1)
    return found.reshape(*vertices.shape[:-3], -1, 3)


def _held(hands: Motion, cells: tuple[int, int]) -> list[int]:
    columns = cells[0] + 1
    return [round(v * cells[1]) * columns + round(u * cells[0]) for u, v in hands.held]


def _nuno(hands: Motion, times: np.ndarray, cells: tuple[int, int], radius: float) -> np.ndarray:
    import nuno

    world = nuno.World(device="cpu", substeps=45)
    world.add(nuno.box((1.2, 1.2, 0.04), position=(0, 0, TOP - 0.02)))
    towel = world.add(nuno.sheet(hands.size, cells, position=(0, 0, TOP + radius)))
    material = nuno.Cloth(
        area_density=0.32 * hands.heavier,
        bending_rigidity=2e-4 * hands.stiffer,
        shear_stiffness=150.0,
        friction=hands.friction,
        thickness=2 * radius,
    )
    world.attach(towel, material)
    start = flat(cells, radius, hands.size).reshape(-1, 3)
    order = [int(np.argmin(np.linalg.norm(towel.vertices - p, axis=1))) for p in start]
    for k, way in zip(_held(hands, cells), hands.moves, strict=True):
        world.grip(towel, [order[k]], to=nuno.Path(hands.times, start[k] + way))
    return world.trace(towel, times)[:, order].reshape(len(times), cells[1] + 1, cells[0] + 1, 3).astype(float)


def _mujoco(hands: Motion, times: np.ndarray, cells: tuple[int, int], radius: float) -> np.ndarray:
    import mujoco

    n, step, stiffer = (cells[0] + 1, cells[1] + 1), 0.002, hands.stiffer**0.5  # which of bending, of a thickness
    corners = flat((1, 1), radius, hands.size).reshape(-1, 3)
    held = [corners[int(2 * round(v) + round(u))] for u, v in hands.held]
    bodies = "".join(f'<body name="m{k}" mocap="true" pos="{p[0]} {p[1]} {p[2]}"/>' for k, p in enumerate(held))

    def named(u: float, v: float) -> str:  # a grid of flexcomp goes along y first
        return f"c_{round(u * cells[0]) * n[1] + round(v * cells[1])}"

    ties = "".join(
        f'<connect body1="{named(u, v)}" body2="m{k}" anchor="0 0 0" solref="0.008 1"/>'
        for k, (u, v) in enumerate(hands.held)
    )
    model = mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{step}" integrator="discrete" solver="Newton" tolerance="1e-6"/>
      <worldbody><geom type="plane" size="2 2 .1" pos="0 0 {TOP}" friction="{hands.friction}"/>{bodies}
        <flexcomp name="c" type="grid" dim="2" count="{n[0]} {n[1]} 1" radius="{radius}"
          mass="{0.25 * hands.heavier * hands.size[0] * hands.size[1]}" pos="0 0 {TOP + radius}"
          spacing="{hands.size[0] / cells[0]} {hands.size[1] / cells[1]} 0.1">
          <contact selfcollide="auto" friction="{hands.friction}"/>
          <elasticity young="{1e6 / stiffer}" poisson="0.2" thickness="{1e-3 * stiffer}"
            damping="0.002" elastic2d="both"/>
        </flexcomp></worldbody><equality>{ties}</equality></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    start = flat(cells, radius, hands.size).reshape(-1, 3)
    own = data.flexvert_xpos.copy()
    order = [int(np.argmin(np.linalg.norm(own - p, axis=1))) for p in start]
    assert np.abs(own[order] - start).max() < 1e-6
    found = []
    for time in times:
        while data.time < time - 0.5 * step:
            for k, move in enumerate(hands.at(data.time + step)):
                data.mocap_pos[k] = held[k] + move
            mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_flex(model, data)
        found.append(data.flexvert_xpos[order].copy())
    return np.reshape(found, (len(times), cells[1] + 1, cells[0] + 1, 3))


def _newton(hands: Motion, times: np.ndarray, cells: tuple[int, int], radius: float) -> np.ndarray:
    import warp as wp

    with wp.ScopedDevice("cuda:0" if wp.get_cuda_device_count() else "cpu"):
        return _newton_on_device(hands, times, cells, radius)


def _newton_on_device(hands: Motion, times: np.ndarray, cells: tuple[int, int], radius: float) -> np.ndarray:
    import newton
    import warp as wp

    start = flat(cells, radius, hands.size).reshape(-1, 3)
    columns = cells[0] + 1
    quads = [(j * columns + i, j * columns + i + 1) for j in range(cells[1]) for i in range(cells[0])]
    triangles = [t for a, b in quads for t in ((a, b, b + columns), (a, b + columns, a + columns))]
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, -9.81))
    builder.add_cloth_mesh(
        pos=wp.vec3(0, 0, 0), rot=wp.quat_identity(), scale=1.0, vel=wp.vec3(0, 0, 0),
        vertices=[wp.vec3(*p) for p in start], indices=np.ravel(triangles).tolist(), density=0.2 * hands.heavier,
        particle_radius=radius, tri_ke=1e3, tri_ka=1e3, tri_kd=1e-2, edge_ke=1e-3 * hands.stiffer, edge_kd=1e-4,
    )  # fmt: skip
    builder.color(include_bending=True)
    builder.add_ground_plane(height=TOP)
    model = builder.finalize()
    model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_mu = 1e3, 1e-3, hands.friction
    held = _held(hands, cells)
    flags = model.particle_flags.numpy()
    flags[held] &= ~int(newton.ParticleFlags.ACTIVE)
    model.particle_flags.assign(flags)
    cell = hands.size[0] / cells[0]
    solver = newton.solvers.SolverVBD(
        model, iterations=10, particle_enable_self_contact=True, particle_self_contact_margin=0.2 * cell,
        particle_self_contact_gap=0.1 * cell,
    )  # fmt: skip
    now, then, control = model.state(), model.state(), model.control()
    pipeline = newton.CollisionPipeline(model)
    contacts, step, clock, found = pipeline.contacts(), 1.0 / 600.0, 0.0, []
    for time in times:
        while clock < time - 0.5 * step:
            clock += step
            places = now.particle_q.numpy()
            places[held] = start[held] + hands.at(clock)
            now.particle_q.assign(places)
            now.clear_forces()
            pipeline.collide(now, contacts)
            solver.step(now, then, control, contacts, step)
            now, then = then, now
        found.append(now.particle_q.numpy().copy())
    return np.reshape(found, (len(times), cells[1] + 1, cells[0] + 1, 3)).astype(float)
