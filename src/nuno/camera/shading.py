"""Kernels that colour what the rasteriser drew: light, shadows, patterns, and pixels as a camera gives them.

Every pixel's key names the triangle that is seen there. Its ray meets the triangle's plane where the surface is; the
corners' normals are mixed there, which makes curved surfaces smooth, except over edges that are sharp.
"""
# ruff: noqa: UP018, RUF046  (in Warp int(0) is a variable, 0 a constant that loops cannot change)
# Warp's kernels are Python to a type checker, but not with Python's types
# mypy: disable-error-code="misc, index, attr-defined, operator, call-overload"
# mypy: disable-error-code="assignment, arg-type, valid-type"

import warp as wp

from nuno.camera.raster import DEPTH_STEP, ID_BACKGROUND, ID_BITS

wp.set_module_options({"enable_backward": False})

_LABELS = wp.constant((1 << ID_BITS) - 1)
_NOTHING = wp.constant(wp.int64(ID_BACKGROUND))
_STEP = wp.constant(DEPTH_STEP)
_CREASE = wp.constant(0.75)  # cosine between a corner's normal and the face's below which the edge is drawn sharp
_BLUR = wp.constant(1)  # texels around a point's own in the shadow map that are asked too


@wp.struct
class Light:
    """A lamp, and what it lights; colours are amounts of light, not what screens take."""

    place: wp.vec3  # [m]
    lamp: wp.vec3  # its light
    sky: wp.vec3  # what comes from everywhere, most from above
    background: wp.vec3
    rotation: wp.mat33  # world to the shadow map's camera
    focal: float  # [px] of the shadow map
    size: int  # [px], 0 without shadows
    slack: float  # [m] by which a point may be behind the map's surface and still be lit


@wp.struct
class Looks:
    """The looks of bodies as they are drawn, by body."""

    color: wp.array[wp.vec3]
    other: wp.array[wp.vec3]  # of a chequered body's other fields
    tile: wp.array[float]  # [m], side of its fields, 0 without
    index: wp.array[wp.int32]  # in world.bodies


@wp.func
def _lit(point: wp.vec3, normal: wp.vec3, world: int, light: Light, shadow: wp.array3d[wp.int64]) -> float:
    """Return how much of the lamp reaches a point, 0 to 1."""
    if light.size == 0:
        return 1.0
    # a texel and a half off the surface, which else would shade itself where the light grazes it
    away = wp.length(point - light.place) / light.focal * 1.5 * float(1 + _BLUR)
    p = light.rotation * (point + away * normal - light.place)
    if p[2] <= 0.0:
        return 0.0
    middle = 0.5 * float(light.size - 1)
    u = int(wp.floor(light.focal * p[0] / p[2] + middle + 0.5))
    v = int(wp.floor(light.focal * p[1] / p[2] + middle + 0.5))
    count = float(0.0)
    lit = float(0.0)
    for dv in range(-_BLUR, _BLUR + 1):
        for du in range(-_BLUR, _BLUR + 1):
            if u + du >= 0 and u + du < light.size and v + dv >= 0 and v + dv < light.size:
                key = shadow[world, v + dv, u + du]
                count += 1.0
                if key == _NOTHING or float(key >> wp.int64(20)) * _STEP > p[2] - light.slack:
                    lit += 1.0
    if count == 0.0:
        return 1.0
    return lit / count


@wp.kernel
def shade(
    # what was drawn
    keys: wp.array3d[wp.int64],
    shadow: wp.array3d[wp.int64],
    rays: wp.array2d[wp.vec3],  # in the camera's frame
    turn: wp.mat33,  # camera to world
    origin: wp.vec3,
    positions: wp.array2d[wp.vec3],
    normals: wp.array2d[wp.vec3],
    local: wp.array[wp.vec3],
    faces: wp.array[wp.vec3i],
    owner: wp.array[wp.int32],
    face_count: int,
    plane_normals: wp.array[wp.vec3],
    looks: Looks,
    light: Light,
    # out
    color_out: wp.array3d[wp.vec3],
):
    """Light that reaches each pixel."""
    world, row, column = wp.tid()
    key = keys[world, row, column]
    if key == _NOTHING:
        color_out[world, row, column] = light.background
        return
    label = int(key & wp.int64(_LABELS))
    ray = turn * rays[row, column]
    body = owner[label]
    color = looks.color[body]
    tile = looks.tile[body]
    depth = float(key >> wp.int64(20)) * _STEP
    point = origin + depth * ray
    normal = wp.vec3(0.0, 0.0, 1.0)
    place = point
    if label >= face_count:
        normal = plane_normals[label - face_count]
    else:
        corners = faces[label]
        a = positions[world, corners[0]]
        b = positions[world, corners[1]]
        c = positions[world, corners[2]]
        flat = wp.normalize(wp.cross(b - a, c - a))
        # weights of the corners: where the ray meets the plane (Moeller and Trumbore 1997)
        q = wp.cross(ray, c - a)
        det = wp.dot(b - a, q)
        s = origin - a
        u = float(0.3333333)
        v = float(0.3333333)
        if wp.abs(det) > 1.0e-12:
            u = wp.clamp(wp.dot(s, q) / det, 0.0, 1.0)
            v = wp.clamp(wp.dot(ray, wp.cross(s, b - a)) / det, 0.0, 1.0 - u)
        na = normals[world, corners[0]]
        nb = normals[world, corners[1]]
        nc = normals[world, corners[2]]
        if wp.dot(na, flat) < _CREASE:
            na = flat
        if wp.dot(nb, flat) < _CREASE:
            nb = flat
        if wp.dot(nc, flat) < _CREASE:
            nc = flat
        normal = wp.normalize((1.0 - u - v) * na + u * nb + v * nc)
        place = (1.0 - u - v) * local[corners[0]] + u * local[corners[1]] + v * local[corners[2]]
    if wp.dot(normal, ray) > 0.0:  # the side that looks at the camera
        normal = -normal
    if tile > 0.0:
        # half a field off, so that a surface in a plane of the body's frame does not flicker between two
        fields = wp.floor(place[0] / tile + 0.5) + wp.floor(place[1] / tile + 0.5) + wp.floor(place[2] / tile + 0.5)
        if int(fields) % 2 != 0:
            color = looks.other[body]
    towards = wp.normalize(light.place - point)
    facing = wp.max(wp.dot(normal, towards), 0.0)
    if facing > 0.0:
        facing *= _lit(point, normal, world, light, shadow)
    above = 0.7 + 0.3 * normal[2]
    color_out[world, row, column] = wp.cw_mul(color, facing * light.lamp + above * light.sky)


@wp.kernel
def add(light: wp.array3d[wp.vec3], share: float, sum_out: wp.array3d[wp.vec3]):
    """Add a share of the light that reaches each pixel."""
    world, row, column = wp.tid()
    sum_out[world, row, column] += share * light[world, row, column]


@wp.func
def _screen(x: float) -> float:
    """Return what a screen takes of an amount of light (IEC 61966-2-1)."""
    x = wp.clamp(x, 0.0, 1.0)
    if x <= 0.0031308:
        return 12.92 * x
    return 1.055 * wp.pow(x, 1.0 / 2.4) - 0.055


@wp.kernel
def expose(light: wp.array3d[wp.vec3], samples: int, noise: float, seed: int, color_out: wp.array4d[wp.uint8]):
    """Bytes of the mean of samples x samples pixels, with noise."""
    world, row, column = wp.tid()
    total = wp.vec3(0.0, 0.0, 0.0)
    for i in range(samples):
        for j in range(samples):
            total += light[world, row * samples + i, column * samples + j]
    total = total / float(samples * samples)
    pixel = (world * color_out.shape[1] + row) * color_out.shape[2] + column
    state = wp.rand_init(seed, pixel)
    for k in range(3):
        level = 255.0 * _screen(total[k]) + noise * wp.randn(state)
        color_out[world, row, column, k] = wp.uint8(wp.clamp(level + 0.5, 0.0, 255.0))


@wp.kernel
def to_bodies(
    keys: wp.array3d[wp.int64], owner: wp.array[wp.int32], index: wp.array[wp.int32], ids_out: wp.array3d[wp.int32]
):
    """Write which body is seen, -1 for none."""
    world, row, column = wp.tid()
    key = keys[world, row, column]
    found = int(-1)
    if key != _NOTHING:
        found = index[owner[int(key & wp.int64(_LABELS))]]
    ids_out[world, row, column] = found
