"""A triangle rasteriser in Warp: depth and masks of many worlds at once, on the CPU and on CUDA, no OpenGL.

Each pixel is one integer key, ``depth << shift | label``, with the depth in steps of 10 um, and drawing takes
the minimum of keys. An integer minimum does not depend on order, so an image has the same bits for any number
of worlds, threads or devices' schedulers. Two kinds of key images exist:

- int32, one label bit: 0 where the wanted body is in front, 1 elsewhere (masks; half the memory);
- int64, twenty label bits: the index of the body in front (ids), or of the face in front.

Every launcher takes views, so a caller may draw slices of worlds from several threads (a launch on the CPU
runs on the calling thread and releases the GIL): ``draw(keys[a:b], positions[a:b], ...)``. Call :func:`load`
first then.

Conventions and limits:
    Integer pixels are centres; a pixel is covered when its centre is inside. Vertices are snapped to 1/256 px
    (what graphics hardware does), edge functions are exact integers with the top-left rule: triangles that
    share an edge neither leave gaps nor overlap. Triangles are clipped at the near plane, and drawn from both
    sides. A vertex that projects farther than 2**21 px from the origin is moved to that bound. Depths end at
    10 km. Distortion moves vertices; edges stay straight between them, so large triangles want splitting
    beforehand.
"""
# ruff: noqa: UP018, RUF046  (in Warp int(0) is a variable, 0 a constant that loops cannot change)
# Warp's kernels are Python to a type checker, but not with Python's types
# mypy: disable-error-code="misc, index, attr-defined, operator, call-overload"
# mypy: disable-error-code="assignment, arg-type, valid-type"

from typing import Any

import numpy as np
import warp as wp

from nuno.camera.image_region import Region, View
from nuno.camera.projection import project
from nuno.errors import InvalidInputError
from nuno.numbers.cpu_compiler import compile_quickly

compile_quickly(__name__)

DEPTH_STEP = 1.0e-5  # [m]; 1 m of float32 depth has steps of 0.1 um, cloth and table are about 1 mm apart
ID_BITS = 20
LAST_LABEL = (1 << ID_BITS) - 1  # of int64 keys
MASK_BACKGROUND = 2**31 - 1
ID_BACKGROUND = 2**63 - 1

_STEPS = wp.constant(1.0 / DEPTH_STEP)
_FARTHEST = wp.constant(1.0e4)  # [m]; 1e9 steps fit 30 bits
_EDGE_ON = wp.constant(0.3)  # cosine below which the sides of a thick triangle are drawn too: else they are hidden


@wp.func
def _cut(inside: wp.vec3, outside: wp.vec3, near: float) -> wp.vec3:
    """Return where an edge meets the near plane; from the inner end always, so that neighbours get the same bits."""
    t = (inside[2] - near) / (inside[2] - outside[2])
    p = inside + t * (outside - inside)
    return wp.vec3(p[0], p[1], near)


@wp.func
def _owned(dx: wp.int64, dy: wp.int64) -> wp.int64:
    """0 for a top or left edge, which owns the pixel centres on it, else -1 (added to its edge function)."""
    bias = wp.int64(-1)
    if dy < wp.int64(0) or (dy == wp.int64(0) and dx > wp.int64(0)):
        bias = wp.int64(0)
    return bias


@wp.func
def _rasterise(a: wp.vec3, b: wp.vec3, c: wp.vec3, v: View, world: int, label: Any, shift: int, keys: wp.array3d[Any]):
    """Draw one triangle that lies in front of the near plane (vertices in the camera's frame)."""
    sa = project(a, v)
    sb = project(b, v)
    sc = project(c, v)
    left = wp.max((wp.min(sa[0], wp.min(sb[0], sc[0])) + 255) >> 8, v.x0)
    right = wp.min(wp.max(sa[0], wp.max(sb[0], sc[0])) >> 8, v.x0 + v.width - 1)
    top = wp.max((wp.min(sa[1], wp.min(sb[1], sc[1])) + 255) >> 8, v.y0)
    bottom = wp.min(wp.max(sa[1], wp.max(sb[1], sc[1])) >> 8, v.y0 + v.height - 1)
    if left > right or top > bottom:
        return

    ax = wp.int64(sa[0])
    ay = wp.int64(sa[1])
    inverse_a = 1.0 / a[2]
    slope_b = 1.0 / b[2] - inverse_a
    slope_c = 1.0 / c[2] - inverse_a
    bx = wp.int64(sb[0])
    by = wp.int64(sb[1])
    cx = wp.int64(sc[0])
    cy = wp.int64(sc[1])
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if area == wp.int64(0):
        return
    if area < wp.int64(0):  # seen from the back: exchange b and c
        area = -area
        bx = wp.int64(sc[0])
        by = wp.int64(sc[1])
        cx = wp.int64(sb[0])
        cy = wp.int64(sb[1])
        slope_b, slope_c = slope_c, slope_b
    scale = 1.0 / float(area)
    slope_b = slope_b * scale
    slope_c = slope_c * scale

    # edge functions: twice the area that an edge spans with the pixel's centre, exact
    x = wp.int64(left) * wp.int64(256)
    y = wp.int64(top) * wp.int64(256)
    row_ab = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    row_bc = (cx - bx) * (y - by) - (cy - by) * (x - bx)
    row_ca = (ax - cx) * (y - cy) - (ay - cy) * (x - cx)
    own_ab = _owned(bx - ax, by - ay)
    own_bc = _owned(cx - bx, cy - by)
    own_ca = _owned(ax - cx, ay - cy)
    right_ab = (ay - by) * wp.int64(256)
    right_bc = (by - cy) * wp.int64(256)
    right_ca = (cy - ay) * wp.int64(256)
    down_ab = (bx - ax) * wp.int64(256)
    down_bc = (cx - bx) * wp.int64(256)
    down_ca = (ax - cx) * wp.int64(256)
    for row in range(top, bottom + 1):
        ab = row_ab
        bc = row_bc
        ca = row_ca
        for column in range(left, right + 1):
            # the sign bit of the OR is set when any of the three is negative
            if ((ab + own_ab) | (bc + own_bc) | (ca + own_ca)) >= wp.int64(0):
                # 1/z is linear in the image
                inverse = inverse_a + float(ca) * slope_b + float(ab) * slope_c
                depth = wp.min(1.0 / inverse, _FARTHEST)
                steps = keys.dtype(int(depth * _STEPS + 0.5))
                key = (steps << keys.dtype(shift)) | keys.dtype(label)
                wp.atomic_min(keys, world, row - v.y0, column - v.x0, key)
            ab += right_ab
            bc += right_bc
            ca += right_ca
        row_ab += down_ab
        row_bc += down_bc
        row_ca += down_ca


@wp.func
def _clip_and_rasterise(
    corner_a: wp.vec3, corner_b: wp.vec3, corner_c: wp.vec3, v: View, world: int, label: Any, shift: int,
    keys: wp.array3d[Any],
):  # fmt: skip
    """Draw what lies in front of the near plane: nothing, one triangle or two."""
    a = corner_a
    b = corner_b
    c = corner_c
    near = v.near
    inside = int(a[2] >= near) + int(b[2] >= near) + int(c[2] >= near)
    if inside == 0:
        return
    if inside == 1:
        while a[2] < near:  # turn the triangle until a is the one in front
            turned = a
            a = b
            b = c
            c = turned
        b = _cut(a, b, near)
        c = _cut(a, c, near)
    if inside == 2:
        while c[2] >= near:  # turn the triangle until c is the one behind
            turned = a
            a = b
            b = c
            c = turned
        d = _cut(a, c, near)
        c = _cut(b, c, near)
        _rasterise(a, c, d, v, world, label, shift, keys)
    _rasterise(a, b, c, v, world, label, shift, keys)


@wp.kernel
def _draw_triangles(
    positions: wp.array2d[wp.vec3],
    faces: wp.array[wp.vec3i],
    v: View,
    half_thickness: float,
    label: wp.int32,
    shift: wp.int32,
    keys: wp.array3d[Any],
):
    """One thread draws one triangle of one world."""
    world, face = wp.tid()
    name = label
    if label < 0:
        name = face
    corners = faces[face]
    a = v.rotation * (positions[world, corners[0]] - v.origin)
    b = v.rotation * (positions[world, corners[1]] - v.origin)
    c = v.rotation * (positions[world, corners[2]] - v.origin)
    if not wp.isfinite(a + b + c):
        return
    parts = int(1)
    offset = wp.vec3(0.0, 0.0, 0.0)
    if half_thickness > 0.0:
        normal = wp.normalize(wp.cross(b - a, c - a))
        offset = half_thickness * normal
        parts = 2
        if wp.abs(wp.dot(normal, a)) < _EDGE_ON * wp.length(a):
            parts = 8
    for part in range(parts):
        p = a + offset
        q = b + offset
        r = c + offset
        if part == 1:
            p = a - offset
            q = b - offset
            r = c - offset
        if part >= 2:  # a side of the prism, as two triangles
            p = a
            q = b
            if part >= 4:
                p = b
                q = c
            if part >= 6:
                p = c
                q = a
            r = q - offset
            if part % 2 == 0:
                q = q + offset
            else:
                q = p - offset
            p = p + offset
        _clip_and_rasterise(p, q, r, v, world, name, shift, keys)


@wp.kernel
def _draw_depth(depth: wp.array2d[wp.float32], label: wp.int32, shift: wp.int32, keys: wp.array3d[Any]):
    """Merge a depth image [m] (h, w) into every world; pixels without a finite positive depth are left."""
    world, row, column = wp.tid()
    z = depth[row, column]
    if z > 0.0 and z <= _FARTHEST:
        key = (keys.dtype(int(z * _STEPS + 0.5)) << keys.dtype(shift)) | keys.dtype(label)
        wp.atomic_min(keys, world, row, column, key)


@wp.kernel
def _copy_layer(layer: wp.array3d[Any], keys: wp.array3d[Any]):
    world, row, column = wp.tid()
    keys[world, row, column] = layer[0, row, column]


@wp.kernel
def _to_masks(keys: wp.array3d[wp.int32], masks_out: wp.array3d[wp.bool]):
    world, row, column = wp.tid()
    masks_out[world, row, column] = (keys[world, row, column] & 1) == 0


@wp.kernel
def _to_depths(keys: wp.array3d[Any], shift: wp.int32, background: Any, depths_out: wp.array3d[wp.float32]):
    world, row, column = wp.tid()
    key = keys[world, row, column]
    depth = float(wp.inf)
    if key != background:
        depth = float(key >> keys.dtype(shift)) / _STEPS
    depths_out[world, row, column] = depth


@wp.kernel
def _to_ids(keys: wp.array3d[wp.int64], ids_out: wp.array3d[wp.int32]):
    world, row, column = wp.tid()
    key = keys[world, row, column]
    label = int(-1)
    if key != wp.int64(ID_BACKGROUND):
        label = int(key & wp.int64((1 << ID_BITS) - 1))
    ids_out[world, row, column] = label


_to_depths_of = {}
"""By the keys' type: launched as the kernel for any, Warp would take a background of 63 bits for an int32."""

for _key in (wp.int32, wp.int64):
    wp.overload(_draw_triangles, {"keys": wp.array3d[_key]})
    wp.overload(_draw_depth, {"keys": wp.array3d[_key]})
    wp.overload(_copy_layer, {"layer": wp.array3d[_key], "keys": wp.array3d[_key]})
    _to_depths_of[_key] = wp.overload(_to_depths, {"keys": wp.array3d[_key], "background": _key})


def load(device: str | wp.Device) -> None:
    """Compile or load the kernels for a device now, as is needed before several threads launch them."""
    wp.load_module(__name__, device=device)


def key_images(worlds: int, region: Region, device: str | wp.Device, *, ids: bool = False) -> wp.array:
    """Empty key images (worlds, region.height, region.width): int32 for masks, int64 for ids."""
    if worlds < 1:
        raise InvalidInputError(f"at least one world is needed, got {worlds}")
    shape = (worlds, region.height, region.width)
    value, dtype = (ID_BACKGROUND, wp.int64) if ids else (MASK_BACKGROUND, wp.int32)
    return wp.full(shape, value, dtype=dtype, device=device)


def clear(keys: wp.array, layer: wp.array | None = None) -> None:
    """Reset key images (worlds, h, w) to background, or to a static layer (1, h, w) of the same kind."""
    if layer is None:
        keys.fill_(ID_BACKGROUND if keys.dtype == wp.int64 else MASK_BACKGROUND)
        return
    if layer.shape[1:] != keys.shape[1:] or layer.dtype != keys.dtype:
        raise InvalidInputError(
            f"a layer of {layer.shape[1:]} {layer.dtype.__name__} keys does not fit {keys.shape[1:]} "
            f"{keys.dtype.__name__}"
        )
    if wp.get_device(keys.device).is_cpu:
        keys.numpy()[...] = layer.numpy()  # views of the same memory; five times as fast as a kernel there
        return
    wp.launch(_copy_layer, dim=keys.shape, inputs=[layer, keys], device=keys.device)


def draw(
    keys: wp.array, positions: wp.array, faces: wp.array, seen: View, label: int | None, *, thickness: float = 0.0
) -> None:
    """Draw the triangles of every world into its key image.

    Args:
        keys: (worlds, h, w) key images; (h, w) must be the region of ``seen``.
        positions: (worlds, n) vec3 [m], on the same device.
        faces: (m,) vec3i vertex indices, on the same device.
        seen: From :func:`nuno.camera.image_region.view`.
        label: int32 keys: 0 for the wanted body, 1 for whatever may hide it (at equal depth, 0 is seen).
            int64 keys: an index from 0 to 2**20 - 1, or None, by which every face gets its own index.
        thickness: [m], of a sheet: its triangles are drawn twice, moved by half of it to either side, and as
            prisms where they are seen nearly edge-on (they would vanish otherwise).

    Raises:
        InvalidInputError: shapes, devices or the label do not fit each other.
    """
    if positions.ndim != 2 or positions.shape[0] != keys.shape[0]:
        raise InvalidInputError(f"positions have shape {positions.shape} for {keys.shape[0]} key images")
    if keys.shape[1:] != (seen.height, seen.width):
        raise InvalidInputError(f"key images of {keys.shape[1:]} for a view of {(seen.height, seen.width)}")
    if positions.device != keys.device or faces.device != keys.device:
        raise InvalidInputError(
            f"keys are on {keys.device}, positions on {positions.device}, faces on {faces.device}; use one device"
        )
    if not 0.0 <= thickness < np.inf:
        raise InvalidInputError(f"thickness must be at least 0 [m], got {thickness}")
    shift = _shift(keys, faces.shape[0] - 1 if label is None else label)
    given = -1 if label is None else label
    wp.launch(
        _draw_triangles, dim=(keys.shape[0], faces.shape[0]),
        inputs=[positions, faces, seen, 0.5 * thickness, given, shift, keys], device=keys.device,
    )  # fmt: skip


def draw_depth(keys: wp.array, depth: np.ndarray, label: int) -> None:
    """Merge a depth image (h, w) [m] (inf, NaN: nothing) into all key images; labels as in :func:`draw`."""
    depth = np.ascontiguousarray(depth, dtype=np.float32)
    if depth.shape != keys.shape[1:]:
        raise InvalidInputError(f"a depth image of {depth.shape} for key images of {keys.shape[1:]}")
    shift = _shift(keys, label)
    wp.launch(
        _draw_depth, dim=keys.shape,
        inputs=[wp.array(depth, dtype=wp.float32, device=keys.device), label, shift, keys],
        device=keys.device,
    )  # fmt: skip


def _shift(keys: wp.array, label: int) -> int:
    shift = ID_BITS if keys.dtype == wp.int64 else 1
    if not 0 <= label < 2**shift:
        raise InvalidInputError(f"{keys.dtype.__name__} keys take labels 0 to {2**shift - 1}, got {label}")
    return shift


def masks_of(keys: wp.array, *, out: wp.array | None = None) -> wp.array:
    """Masks (worlds, h, w) bool of int32 key images: where label 0 is in front."""
    out = wp.empty(keys.shape, dtype=wp.bool, device=keys.device) if out is None else out
    wp.launch(_to_masks, dim=keys.shape, inputs=[keys, out], device=keys.device)
    return out


def depths_of(keys: wp.array, *, out: wp.array | None = None) -> wp.array:
    """Depths (worlds, h, w) float32 [m] along the optical axis, in steps of 10 um; inf where nothing is."""
    out = wp.empty(keys.shape, dtype=wp.float32, device=keys.device) if out is None else out
    with_ids = keys.dtype == wp.int64
    arguments = [ID_BITS, ID_BACKGROUND] if with_ids else [1, MASK_BACKGROUND]
    wp.launch(_to_depths_of[keys.dtype], dim=keys.shape, inputs=[keys, *arguments, out], device=keys.device)
    return out


def ids_of(keys: wp.array, *, out: wp.array | None = None) -> wp.array:
    """Labels (worlds, h, w) int32 of int64 key images, -1 where nothing was drawn."""
    out = wp.empty(keys.shape, dtype=wp.int32, device=keys.device) if out is None else out
    wp.launch(_to_ids, dim=keys.shape, inputs=[keys, out], device=keys.device)
    return out
