"""Bending from a rigidity in N m, as quadratic energies of second differences (isometric bending).

The energy density 1/2 B (k_xx^2 + k_yy^2 + 2 k_xy^2) is taken literally: it is isotropic and without Poisson effect.
On a sheet's grid, second differences along grid lines give k_xx and k_yy, the twist of a cell gives k_xy. On a general
mesh a triangle and its neighbours, up to six vertices, give all three (`nuno.scene.patches`).

All are vector constraints c = sum k_i x_i of zero target, whose XPBD update needs neither a root nor a branch:
dx_i = -w_i k_i c / (sum w_i k_i^2 + alpha / dt^2), its denominator as in `bend_stiffness`.
"""

from typing import Any

import warp as wp

from nuno.solver.lanes import add, beside, fill, most, mul, over, root, sub, times  # noqa: F401
from nuno.solver.membrane import shift
from nuno.solver.vector import at, is_set, put, scaled


@wp.func
def bend_stiffness(weight: Any, alpha: Any):
    """The denominator of a bend's update: weight / 2 + alpha, at least 0.8 weight.

    With lambda starting at zero, one pass adds to the static compliance what the same substep's other constraints do
    not undo, about half of the weight; taken off, a strip hangs as its rigidity says at far larger steps. The floor
    bounds the over-relaxation to 1.25, well inside of 2, where it would oscillate.
    """
    return most(scaled(weight, 0.5) + alpha, scaled(weight, 0.8)) + fill(weight, 1.0e-12)


@wp.func
def bend_line(t: Any, a: Any, b: Any, c: Any, alpha: Any):
    """Three vertices in a row: c = x_0 - 2 x_1 + x_2."""
    ax = at(t.x, a)
    ay = at(t.y, a)
    az = at(t.z, a)
    bx = at(t.x, b)
    by = at(t.y, b)
    bz = at(t.z, b)
    dx = at(t.x, c)
    dy = at(t.y, c)
    dz = at(t.z, c)
    cx = beside(ax, bx) - beside(bx, bx) * 2.0 + beside(dx, bx)
    cy = beside(ay, by) - beside(by, by) * 2.0 + beside(dy, by)
    cz = beside(az, bz) - beside(bz, bz) * 2.0 + beside(dz, bz)
    wa = at(t.w, a)
    wb = at(t.w, b)
    wc = at(t.w, c)
    weight = wa + wb * 4.0 + wc
    s = over(fill(cx, -1.0), bend_stiffness(weight, alpha))
    sa = times(s, wa)
    sb = times(s, wb) * -2.0
    sc = times(s, wc)
    put(t.x, a, ax + times(cx, sa))
    put(t.y, a, ay + times(cy, sa))
    put(t.z, a, az + times(cz, sa))
    put(t.x, b, bx + times(cx, sb))
    put(t.y, b, by + times(cy, sb))
    put(t.z, b, bz + times(cz, sb))
    put(t.x, c, dx + times(cx, sc))
    put(t.y, c, dy + times(cy, sc))
    put(t.z, c, dz + times(cz, sc))


@wp.func
def twist_of(x: Any, a: Any, b: Any, c: Any, d: Any):
    """The coordinates' x_0 - x_1 - x_2 + x_3."""
    base = at(x, a)
    return beside(base, base) - beside(at(x, b), base) - beside(at(x, c), base) + beside(at(x, d), base)


@wp.func
def bend_twist(t: Any, a: Any, b: Any, c: Any, d: Any, alpha: Any):
    """The corners of a cell: c = x_0 - x_1 - x_2 + x_3."""
    cx = twist_of(t.x, a, b, c, d)
    cy = twist_of(t.y, a, b, c, d)
    cz = twist_of(t.z, a, b, c, d)
    wa = at(t.w, a)
    wb = at(t.w, b)
    wc = at(t.w, c)
    wd = at(t.w, d)
    weight = wa + wb + wc + wd
    s = over(fill(cx, -1.0), bend_stiffness(weight, alpha))
    shift(t, a, cx, cy, cz, times(s, wa))
    shift(t, b, cx, cy, cz, times(-s, wb))
    shift(t, c, cx, cy, cz, times(-s, wc))
    shift(t, d, cx, cy, cz, times(s, wd))


@wp.func
def total(weights: Any, row: int, x0: Any, x1: Any, x2: Any, x3: Any, x4: Any, x5: Any):
    """The sum of six coordinates, weighed with the numbers from ``row`` on, which add up to zero."""
    r0 = beside(x0, x0)
    r1 = beside(x1, x0)
    r2 = beside(x2, x0)
    r3 = beside(x3, x0)
    r4 = beside(x4, x0)
    r5 = beside(x5, x0)
    near = scaled(r0, weights[row]) + scaled(r1, weights[row + 1]) + scaled(r2, weights[row + 2])
    return near + scaled(r3, weights[row + 3]) + scaled(r4, weights[row + 4]) + scaled(r5, weights[row + 5])


@wp.func
def total_at(x: Any, weights: Any, row: int, i0: Any, i1: Any, i2: Any, i3: Any, i4: Any, i5: Any):
    """The weighed sum of six particles' coordinates."""
    return total(weights, row, at(x, i0), at(x, i1), at(x, i2), at(x, i3), at(x, i4), at(x, i5))


@wp.func
def bend_patch(t: Any, table: Any, k: int, alpha: Any):
    """A triangle and its neighbours: three times c = sum k_i x_i - rest, one after the other.

    ``rest`` turns with the triangle: a sum of its two sides from vertex 0 and its unit normal. A triangle at the rim
    repeats vertex 0 for neighbours that it has not, with no weight; so vertex 0 is written last.
    """
    i0 = table.patch[6 * k + 0]
    i1 = table.patch[6 * k + 1]
    i2 = table.patch[6 * k + 2]
    i3 = table.patch[6 * k + 3]
    i4 = table.patch[6 * k + 4]
    i5 = table.patch[6 * k + 5]
    w0 = at(t.w, i0)
    w1 = at(t.w, i1)
    w2 = at(t.w, i2)
    w3 = at(t.w, i3)
    w4 = at(t.w, i4)
    w5 = at(t.w, i5)
    x0 = at(t.x, i0)
    x1 = at(t.x, i1)
    x2 = at(t.x, i2)
    x3 = at(t.x, i3)
    x4 = at(t.x, i4)
    x5 = at(t.x, i5)
    y0 = at(t.y, i0)
    y1 = at(t.y, i1)
    y2 = at(t.y, i2)
    y3 = at(t.y, i3)
    y4 = at(t.y, i4)
    y5 = at(t.y, i5)
    z0 = at(t.z, i0)
    z1 = at(t.z, i1)
    z2 = at(t.z, i2)
    z3 = at(t.z, i3)
    z4 = at(t.z, i4)
    z5 = at(t.z, i5)
    parts = int(3)  # a variable: the loop stays a loop, and kernels compile sooner
    for j in range(parts):
        row = 18 * k + 6 * j
        cx = total(table.patch_weight, row, x0, x1, x2, x3, x4, x5)
        cy = total(table.patch_weight, row, y0, y1, y2, y3, y4, y5)
        cz = total(table.patch_weight, row, z0, z1, z2, z3, z4, z5)
        weight = fill(cx, 0.0)
        k0 = table.patch_weight[row + 0]
        k1 = table.patch_weight[row + 1]
        k2 = table.patch_weight[row + 2]
        k3 = table.patch_weight[row + 3]
        k4 = table.patch_weight[row + 4]
        k5 = table.patch_weight[row + 5]
        weight = weight + scaled(scaled(w0, k0), k0)
        weight = weight + scaled(scaled(w1, k1), k1)
        weight = weight + scaled(scaled(w2, k2), k2)
        weight = weight + scaled(scaled(w3, k3), k3)
        weight = weight + scaled(scaled(w4, k4), k4)
        weight = weight + scaled(scaled(w5, k5), k5)
        if is_set(table.patch_curved[k]):
            r = 9 * k + 3 * j
            ex = x1 - x0
            ey = y1 - y0
            ez = z1 - z0
            fx = x2 - x0
            fy = y2 - y0
            fz = z2 - z0
            nx = times(ey, fz) - times(ez, fy)
            ny = times(ez, fx) - times(ex, fz)
            nz = times(ex, fy) - times(ey, fx)
            n = scaled(
                over(fill(nx, 1.0), root(times(nx, nx) + times(ny, ny) + times(nz, nz) + fill(nx, 1.0e-20))),
                table.patch_rest[r + 2],
            )
            u = table.patch_rest[r]
            v = table.patch_rest[r + 1]
            cx = cx - scaled(ex, u) - scaled(fx, v) - times(nx, n)
            cy = cy - scaled(ey, u) - scaled(fy, v) - times(ny, n)
            cz = cz - scaled(ez, u) - scaled(fz, v) - times(nz, n)
        s = over(fill(cx, -1.0), bend_stiffness(weight, alpha))
        s0 = scaled(times(s, w0), k0)
        x0 = x0 + times(cx, s0)
        y0 = y0 + times(cy, s0)
        z0 = z0 + times(cz, s0)
        s1 = scaled(times(s, w1), k1)
        x1 = x1 + times(cx, s1)
        y1 = y1 + times(cy, s1)
        z1 = z1 + times(cz, s1)
        s2 = scaled(times(s, w2), k2)
        x2 = x2 + times(cx, s2)
        y2 = y2 + times(cy, s2)
        z2 = z2 + times(cz, s2)
        s3 = scaled(times(s, w3), k3)
        x3 = x3 + times(cx, s3)
        y3 = y3 + times(cy, s3)
        z3 = z3 + times(cz, s3)
        s4 = scaled(times(s, w4), k4)
        x4 = x4 + times(cx, s4)
        y4 = y4 + times(cy, s4)
        z4 = z4 + times(cz, s4)
        s5 = scaled(times(s, w5), k5)
        x5 = x5 + times(cx, s5)
        y5 = y5 + times(cy, s5)
        z5 = z5 + times(cz, s5)
    put(t.x, i5, x5)
    put(t.y, i5, y5)
    put(t.z, i5, z5)
    put(t.x, i4, x4)
    put(t.y, i4, y4)
    put(t.z, i4, z4)
    put(t.x, i3, x3)
    put(t.y, i3, y3)
    put(t.z, i3, z3)
    put(t.x, i2, x2)
    put(t.y, i2, y2)
    put(t.z, i2, z2)
    put(t.x, i1, x1)
    put(t.y, i1, y1)
    put(t.z, i1, z1)
    put(t.x, i0, x0)
    put(t.y, i0, y0)
    put(t.z, i0, z0)
