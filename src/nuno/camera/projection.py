"""Projection in kernels: points in a camera's frame to pixels in fixed-point steps, with OpenCV's distortion."""
# Warp's kernels are Python to a type checker, but not with Python's types
# mypy: disable-error-code="misc, index, attr-defined, operator, call-overload"
# mypy: disable-error-code="assignment, arg-type, valid-type"

import warp as wp

from nuno.camera.image_region import View

SUBPIXELS = 256
"""Steps that a pixel is divided into: what graphics hardware does."""

_SUBPIXELS = wp.constant(float(SUBPIXELS))
_FARTHEST_SUBPIXEL = wp.constant(2.0**29)  # products of two differences then stay below 2**61


@wp.func
def _distort(x: float, y: float, v: View) -> wp.vec2:
    """OpenCV's distortion of a point at one metre of depth."""
    c = v.coefficients
    r2_true = x * x + y * y
    s = 1.0
    if r2_true > v.radius2:
        s = wp.sqrt(v.radius2 / r2_true)
    px = x * s
    py = y * s
    r2 = px * px + py * py
    radial = (1.0 + r2 * (c[0] + r2 * (c[1] + r2 * c[4]))) / (1.0 + r2 * (c[5] + r2 * (c[6] + r2 * c[7])))
    dx = 2.0 * c[2] * px * py + c[3] * (r2 + 2.0 * px * px) + r2 * (c[8] + r2 * c[9])
    dy = c[2] * (r2 + 2.0 * py * py) + 2.0 * c[3] * px * py + r2 * (c[10] + r2 * c[11])
    return wp.vec2((px * radial + dx) / s, (py * radial + dy) / s)


@wp.func
def project(p: wp.vec3, v: View) -> wp.vec2i:
    """Pixel of a point in the camera's frame, in steps of 1/256 px."""
    x = p[0] / p[2]
    y = p[1] / p[2]
    if v.distorted != 0:
        q = _distort(x, y, v)
        x = q[0]
        y = q[1]
    sx = (v.fx * x + v.cx) * _SUBPIXELS
    sy = (v.fy * y + v.cy) * _SUBPIXELS
    sx = wp.clamp(sx, -_FARTHEST_SUBPIXEL, _FARTHEST_SUBPIXEL)
    sy = wp.clamp(sy, -_FARTHEST_SUBPIXEL, _FARTHEST_SUBPIXEL)
    return wp.vec2i(int(wp.floor(sx + 0.5)), int(wp.floor(sy + 0.5)))
