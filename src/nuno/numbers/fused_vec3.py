"""Sums of vectors' products with one rounding a step (fused multiply-add), so that CPU and CUDA give the same bits.

The vectors are those of `nuno.numbers.vec3`; of a product one factor may be lanes and the other floats.
"""

from typing import Any

import warp as wp

from nuno.numbers.doubles import fused, fused_subtract
from nuno.numbers.lanes import mul  # noqa: F401 (the operator)
from nuno.numbers.vec3 import vec3


@wp.func
def fused_dot(a: Any, b: Any):
    """The scalar product a . b."""
    return fused(a.z, b.z, fused(a.y, b.y, a.x * b.x))


@wp.func
def fused_add_dot(a: Any, b: Any, c: Any):
    """The scalar product a . b, plus a number c."""
    return fused(a.z, b.z, fused(a.y, b.y, fused(a.x, b.x, c)))


@wp.func
def fused_cross(a: Any, b: Any):
    """The vector product a x b."""
    x = fused_subtract(a.z, b.y, a.y * b.z)
    y = fused_subtract(a.x, b.z, a.z * b.x)
    z = fused_subtract(a.y, b.x, a.x * b.y)
    return vec3(x, y, z)


@wp.func
def fused_vec(s: Any, v: Any, w: Any):
    """The vector s v + w; w may be a place in doubles."""
    return vec3(fused(s, v.x, w.x), fused(s, v.y, w.y), fused(s, v.z, w.z))


@wp.func
def fused_subtract_vec(s: Any, v: Any, w: Any):
    """The vector w - s v; w may be a place in doubles."""
    return vec3(fused_subtract(s, v.x, w.x), fused_subtract(s, v.y, w.y), fused_subtract(s, v.z, w.z))


@wp.func
def combination(k: Any, e: Any, f: Any, g: Any):
    """The vector k_x e + k_y f + k_z g."""
    x = fused(k.z, g.x, fused(k.y, f.x, k.x * e.x))
    y = fused(k.z, g.y, fused(k.y, f.y, k.x * e.y))
    z = fused(k.z, g.z, fused(k.y, f.z, k.x * e.z))
    return vec3(x, y, z)
