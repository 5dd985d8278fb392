"""The force on a soft ball between two smooth plates: an axisymmetric finite-element reference, and what Nuno gives.

The reference is the solver's own energy, neo-Hookean, in an axisymmetric mesh of quadrilaterals (2 x 2 Gauss points) of
a quarter of the ball's section, finer towards the pole; Newton steps, and the nodes in contact by an active set. Where
the plates go in little, it is Hertz's force 4/3 E / (1 - nu^2) sqrt(R) d^1.5 of each plate.

    python benchmarks/squeezed_ball.py            # the reference at three resolutions
    python benchmarks/squeezed_ball.py --nuno     # Nuno's ball of 12 cells across beside it
"""

import argparse

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

import nuno

RADIUS, YOUNG, POISSON = 0.04, 5e4, 0.3  # [m], [Pa]
DEPTHS = (0.001, 0.002, 0.004, 0.008)  # how far each plate goes in [m]
GAUSS = 3**-0.5


def hertz(depth):
    """Return the force [N] of Hertz's theory."""
    return 4.0 / 3.0 * YOUNG / (1.0 - POISSON**2) * RADIUS**0.5 * depth**1.5


def quarter(cells):
    """Return nodes (n, 2) (r, z) of a quarter disc, quadrilaterals (m, 4), and the nodes of arc, axis and equator."""
    s = np.linspace(0.0, 1.0, cells + 1)
    u, v = np.meshgrid(s**2, 1.0 - (1.0 - s) ** 2, indexing="ij")  # finer towards the pole
    far = np.maximum(u, v)
    share = np.divide(np.minimum(u, v), far, out=np.zeros_like(far), where=far > 0.0)
    angle = np.where(v >= u, 0.25 * np.pi * share, 0.5 * np.pi - 0.25 * np.pi * share)
    nodes = RADIUS * far[..., None] * np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    index = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    quads = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1).reshape(-1, 4)
    return nodes.reshape(-1, 2), quads, index[:, -1], index[0], index[:, 0]


def assembled(rest, quads, now):
    """Return the internal forces (2 n,) [N] and their derivative (2 n, 2 n) [N/m]."""
    mu = YOUNG / (2.0 * (1.0 + POISSON))
    second = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON)) + mu
    dof = np.stack([2 * quads, 2 * quads + 1], axis=-1).reshape(-1, 8)
    force, stiff = np.zeros(2 * len(rest)), np.zeros((len(quads), 8, 8))
    for a in (-GAUSS, GAUSS):
        for b in (-GAUSS, GAUSS):
            shape = np.array([(1 - a) * (1 - b), (1 + a) * (1 - b), (1 + a) * (1 + b), (1 - a) * (1 + b)]) / 4
            slope = np.array([[b - 1, a - 1], [1 - b, -1 - a], [1 + b, 1 + a], [-1 - b, 1 - a]]) / 4
            jacobian = np.einsum("qia,ib->qab", rest[quads], slope)
            gradient = np.einsum("ib,qba->qia", slope, np.linalg.inv(jacobian))
            radius = rest[quads][..., 0] @ shape
            weight = 2.0 * np.pi * radius * np.abs(np.linalg.det(jacobian))
            # F as (rr, rz, zr, zz, around), and its derivative by the quadrilateral's unknowns
            by = np.zeros((len(quads), 5, 8))
            by[:, 0, 0::2] = by[:, 2, 1::2] = gradient[..., 0]
            by[:, 1, 0::2] = by[:, 3, 1::2] = gradient[..., 1]
            by[:, 4, 0::2] = shape / radius[:, None]
            f = np.einsum("qai,qi->qa", by, now.ravel()[dof])
            plane, around = f[:, 0] * f[:, 3] - f[:, 1] * f[:, 2], f[:, 4]
            cofactor = np.stack([f[:, 3] * around, -f[:, 2] * around, -f[:, 1] * around, f[:, 0] * around, plane], 1)
            curved = np.zeros((len(quads), 5, 5))
            for i, j, entry in (
                (0, 3, around), (1, 2, -around), (0, 4, f[:, 3]), (3, 4, f[:, 0]), (1, 4, -f[:, 2]), (2, 4, -f[:, 1]),
            ):  # fmt: skip
                curved[:, i, j] = curved[:, j, i] = entry
            pressure = second * (plane * around - 1.0) - mu
            stress = mu * f + pressure[:, None] * cofactor
            outer = cofactor[:, :, None] * cofactor[:, None]
            tangent = mu * np.eye(5) + second * outer + pressure[:, None, None] * curved
            np.add.at(force, dof, weight[:, None] * np.einsum("qai,qa->qi", by, stress))
            stiff += weight[:, None, None] * (np.swapaxes(by, 1, 2) @ tangent @ by)
    rows, columns = np.repeat(dof, 8, axis=1).ravel(), np.tile(dof, (1, 8)).ravel()
    return force, sp.csr_matrix((stiff.ravel(), (rows, columns)), shape=(2 * len(rest),) * 2)


def reference(cells, depths=DEPTHS):
    """Return the force of a plate [N] at each depth."""
    rest, quads, arc, axis, equator = quarter(cells)
    now, touching, forces = rest.copy(), np.zeros(len(arc), dtype=bool), []
    for depth in depths:
        # Hertz's circle to begin with: the plate on a single node would crush its elements
        touching |= rest[arc, 0] < 0.8 * np.sqrt(RADIUS * depth)
        while True:
            held = np.zeros(2 * len(rest), dtype=bool)
            held[2 * axis] = held[2 * equator + 1] = held[2 * arc[touching] + 1] = True
            for _ in range(30):
                force, stiff = assembled(rest, quads, now)
                step = np.zeros(2 * len(rest))
                step[2 * arc[touching] + 1] = RADIUS - depth - now[arc[touching], 1]
                step[~held] = spsolve(stiff[~held][:, ~held].tocsc(), -(force + stiff @ step)[~held])
                now = now + step.reshape(-1, 2)
                if np.abs(step).max() < 1e-10 * RADIUS:
                    break
            pressing = -assembled(rest, quads, now)[0][2 * arc + 1]
            touched = np.where(touching, pressing > 0.0, now[arc, 1] > RADIUS - depth + 1e-12)
            if (touched == touching).all():
                break
            touching = touched
        forces.append(float(pressing[touching].sum()))
    return forces


def squeezed(across, **options):
    """Return the force [N] that Nuno's ball of ``across`` cells bears at each depth, at the default substeps."""
    world = nuno.World(gravity=(0.0, 0.0, 0.0), device="cpu")
    ball = world.add(nuno.soft_sphere(RADIUS, 2.0 * RADIUS / across, name="ball", **options))
    away = np.array([RADIUS + 0.005, 0.0, 0.0])
    plates = [
        (sign, world.add(nuno.box((0.01, 0.12, 0.12), name=name, position=sign * away)))
        for sign, name in ((-1, "left"), (1, "right"))
    ]
    world.attach(
        ball, nuno.Soft(density=200.0, youngs_modulus=YOUNG, poisson_ratio=POISSON, damping=0.01, friction=0.0)
    )
    forces = []
    for depth in DEPTHS:
        for sign, plate in plates:
            path = [plate.position, sign * (away - [depth, 0.0, 0.0])]
            world.move(plate, nuno.Path([world.time, world.time + 0.3], path, interpolation="minimum_jerk"))
        world.run(0.45)
        found = world.contacts(ball)
        forces.append(sum(f[0] for f, other in zip(found.forces, found.others, strict=True) if other == "left"))
    return forces


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nuno", action="store_true", help="run Nuno's balls too")
    given = parser.parse_args()
    print(f"plates in by {', '.join(f'{1e3 * d:g}' for d in DEPTHS)} mm; forces over Hertz's")
    rows = [(f"reference, {n} x {n} cells", reference(n)) for n in (12, 18, 27)]
    if given.nuno:
        rows += [(f"{kind}, 12 across", squeezed(12, tetrahedraliser=kind)) for kind in ("fitted", "lattice")]
    for name, forces in rows:
        print(f"{name:28s}", *(f"{f / hertz(d):7.3f}" for f, d in zip(forces, DEPTHS, strict=True)), flush=True)


if __name__ == "__main__":
    main()
