"""Bending from a rigidity in N m, as quadratic energies of second differences (isometric bending).

The energy density 1/2 B (k_xx^2 + k_yy^2 + 2 k_xy^2) is taken literally: it is isotropic and without Poisson effect.
On a sheet's grid, second differences along grid lines give k_xx and k_yy, the twist of a cell gives k_xy. On a general
mesh a triangle and its neighbours, up to six vertices, give all three (`nuno.topology.patches`). For what a cloth's
energy comes to see `nuno.bodies.cloth_measures`.

All are vector constraints c = sum k_i x_i of zero target, whose XPBD update needs neither a root nor a branch:
dx_i = -w_i k_i c / (sum w_i k_i^2 + alpha / dt^2), its denominator as in `bend_stiffness`.
"""

from typing import Any

import warp as wp

from nuno.numbers.element_access import at, is_set
from nuno.numbers.lanes import add, div, full_like, maximum, mul, product, sqrt, sub  # noqa: F401
from nuno.numbers.vec3 import cross, dot, offset, position, put_position


@wp.func
def bend_stiffness(weight: Any, alpha: Any):
    """The denominator of a bend's update: weight / 2 + alpha, at least 0.8 weight.

    With lambda starting at zero, one pass adds to the static compliance what the same substep's other constraints do
    not undo, about half of the weight; taken off, a strip hangs as its rigidity says at far larger steps. The floor
    bounds the over-relaxation to 1.25, well inside of 2, where it would oscillate.
    """
    return maximum(weight * 0.5 + alpha, weight * 0.8) + 1.0e-12


@wp.func
def bend_alpha(compliance: Any, scale: Any, rate: float):
    """The compliance of a bend over dt^2: the material's, times the factor of its size and ``rate``, 1 / dt^2."""
    return product(compliance, scale * rate)


@wp.func
def project_line(xa: Any, xb: Any, xc: Any, wa: Any, wb: Any, wc: Any, alpha: Any):
    """Three vertices in a row: c = x_0 - 2 x_1 + x_2. Returns their positions after the update."""
    error = offset(xa, xb) - offset(xb, xb) * 2.0 + offset(xc, xb)
    weight = wa + wb * 4.0 + wc
    s = -1.0 / bend_stiffness(weight, alpha)
    return xa + error * (s * wa), xb + error * (s * wb * -2.0), xc + error * (s * wc)


@wp.func
def bend_line(t: Any, a: Any, b: Any, c: Any, alpha: Any):
    """`project_line` of three particles."""
    xa, xb, xc = project_line(
        position(t, a), position(t, b), position(t, c), at(t.w, a), at(t.w, b), at(t.w, c), alpha
    )  # fmt: skip
    put_position(t, a, xa)
    put_position(t, b, xb)
    put_position(t, c, xc)


@wp.func
def twist_of(a: Any, b: Any, c: Any, d: Any):
    """The places' x_0 - x_1 - x_2 + x_3."""
    return offset(a, a) - offset(b, a) - offset(c, a) + offset(d, a)


@wp.func
def project_twist(xa: Any, xb: Any, xc: Any, xd: Any, wa: Any, wb: Any, wc: Any, wd: Any, alpha: Any):
    """The corners of a cell: c = x_0 - x_1 - x_2 + x_3. Returns their positions after the update."""
    error = twist_of(xa, xb, xc, xd)
    weight = wa + wb + wc + wd
    s = -1.0 / bend_stiffness(weight, alpha)
    return xa + error * (s * wa), xb + error * (-s * wb), xc + error * (-s * wc), xd + error * (s * wd)


@wp.func
def bend_twist(t: Any, a: Any, b: Any, c: Any, d: Any, alpha: Any):
    """`project_twist` of four particles."""
    xa, xb, xc, xd = project_twist(
        position(t, a), position(t, b), position(t, c), position(t, d),
        at(t.w, a), at(t.w, b), at(t.w, c), at(t.w, d), alpha,
    )  # fmt: skip
    put_position(t, a, xa)
    put_position(t, b, xb)
    put_position(t, c, xc)
    put_position(t, d, xd)


@wp.func
def total(weights: Any, row: int, x0: Any, x1: Any, x2: Any, x3: Any, x4: Any, x5: Any):
    """The sum of six places, weighed with the numbers from ``row`` on, which add up to zero."""
    mean = offset(x0, x0) * weights[row] + offset(x1, x0) * weights[row + 1] + offset(x2, x0) * weights[row + 2]
    mean = mean + offset(x3, x0) * weights[row + 3] + offset(x4, x0) * weights[row + 4]
    return mean + offset(x5, x0) * weights[row + 5]


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
    x0 = position(t, i0)
    x1 = position(t, i1)
    x2 = position(t, i2)
    x3 = position(t, i3)
    x4 = position(t, i4)
    x5 = position(t, i5)
    parts = int(3)  # a variable: the loop stays a loop, and kernels compile sooner
    for j in range(parts):
        row = 18 * k + 6 * j
        error = total(table.patch_weight, row, x0, x1, x2, x3, x4, x5)
        weight = full_like(error.x, 0.0)
        k0 = table.patch_weight[row + 0]
        k1 = table.patch_weight[row + 1]
        k2 = table.patch_weight[row + 2]
        k3 = table.patch_weight[row + 3]
        k4 = table.patch_weight[row + 4]
        k5 = table.patch_weight[row + 5]
        weight = weight + w0 * k0 * k0
        weight = weight + w1 * k1 * k1
        weight = weight + w2 * k2 * k2
        weight = weight + w3 * k3 * k3
        weight = weight + w4 * k4 * k4
        weight = weight + w5 * k5 * k5
        if is_set(table.patch_curved[k]):
            r = 9 * k + 3 * j
            e = x1 - x0
            f = x2 - x0
            n = cross(e, f)
            scale = 1.0 / sqrt(dot(n, n) + 1.0e-20) * table.patch_rest[r + 2]
            error = error - e * table.patch_rest[r] - f * table.patch_rest[r + 1] - n * scale
        s = -1.0 / bend_stiffness(weight, alpha)
        x0 = x0 + error * (s * w0 * k0)
        x1 = x1 + error * (s * w1 * k1)
        x2 = x2 + error * (s * w2 * k2)
        x3 = x3 + error * (s * w3 * k3)
        x4 = x4 + error * (s * w4 * k4)
        x5 = x5 + error * (s * w5 * k5)
    put_position(t, i5, x5)
    put_position(t, i4, x4)
    put_position(t, i3, x3)
    put_position(t, i2, x2)
    put_position(t, i1, x1)
    put_position(t, i0, x0)
