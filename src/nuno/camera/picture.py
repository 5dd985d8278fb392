"""Pictures of a World as a camera takes them: colour, depth and bodies at once, offscreen, on the world's device."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from nuno.camera import raster, shading
from nuno.camera.body_masks import masks_by_name
from nuno.camera.camera import Camera
from nuno.camera.image_region import Region, view
from nuno.camera.lamp import Lamp
from nuno.camera.render import _hidden, _split, body_index
from nuno.camera.small_png import small_png
from nuno.errors import InvalidInputError
from nuno.files.whole_file import file_path, write_whole
from nuno.shapes.color import linear, rgb
from nuno.shapes.shape import Shape
from nuno.validation import check_fields, checked, count, number

if TYPE_CHECKING:
    from nuno.numbers.device_array import DeviceArray

SHADOW_PIXELS = 1024
SHADOW_SLACK = 1e-3
"""[m] What keeps a surface from shading itself between the texels of the shadow map."""


@dataclass(frozen=True)
class Chequer:
    """A body's surface in fields of two colours, its own and another, which move with it.

    Attributes:
        size: Side of a field [m], in the body's frame; of a cloth, before anything deformed it.
        color: The other colour.
    """

    size: float
    color: Any = "black"

    def __post_init__(self) -> None:
        check_fields(self)
        number("a chequer's size", self.size, above=0.0)
        rgb(self.color)


@dataclass(frozen=True, eq=False)
class Picture:
    """An image that a camera took at one time. Arrays of a single world; in a batch with a first axis of worlds.

    Attributes:
        camera: The camera, where it was.
        time: [s], of the world.
        color: (h, w, 3) uint8 Warp array, red, green and blue.
        depth: (h, w) float32 Warp array [m] along the camera's axis, inf where nothing is.
        ids: (h, w) int32 Warp array, the index in ``world.bodies`` of the body that is seen, -1 for none.
        bodies: Those bodies.
    """

    camera: Camera
    time: float
    color: DeviceArray
    depth: DeviceArray
    ids: DeviceArray
    bodies: tuple[Any, ...] = field(repr=False)

    def __repr__(self) -> str:
        size = f"{self.camera.width} x {self.camera.height} px"
        return f"<Picture of {size} at t = {self.time:.3f} s, {len(self.bodies)} bodies>"

    def _repr_png_(self) -> bytes:
        """Return a small PNG, of a batch its first worlds side by side."""
        return small_png(self.color.numpy())

    def save(self, path: str | PathLike[str]) -> None:
        """Write the colours to a file, whose ending names the format (PNG loses nothing).

        Raises:
            InvalidInputError: the picture of a batch, or an ending that OpenCV cannot write.
            FileWriteError: the file cannot be written.
        """
        import cv2

        goal, colors = file_path(path), self.color.numpy()
        if colors.ndim != 3:
            raise InvalidInputError(f"one world's picture can be saved, got those of {len(colors)}")
        try:
            _, packed = cv2.imencode(goal.suffix, colors[..., ::-1])
        except cv2.error as error:
            raise InvalidInputError(f"a picture's file ends in .png, .jpg or the like, got {str(path)!r}") from error
        write_whole(goal, packed.tobytes())

    def mask(self, *bodies: Any) -> np.ndarray:
        """Return where any of the bodies, or of their names, is seen: bool (h, w), in a batch (worlds, h, w).

        Raises:
            UnknownNameError: a body that was not there.
        """
        wanted = [body_index(self, body) for body in bodies]
        return np.isin(self.ids.numpy(), wanted)

    def masks(self, *bodies: Any) -> dict[str, DeviceArray]:
        """Return where each of some bodies, or of all, is seen: by name, bool Warp arrays of the shape of ``ids``.

        Raises:
            UnknownNameError: a body that was not there.
        """
        return masks_by_name(self.ids, self, bodies)


@checked
def take_picture(
    world: Any, camera: Camera, *, lamp: Lamp | None = None, background: Any = (0.62, 0.66, 0.7),
    patterns: Mapping[Any, Chequer] | None = None, without: Iterable[Any] = (),
    instead: Mapping[Any, Sequence[Any]] | None = None, samples: int = 1, noise: float = 0.0, seed: int = 0,
) -> Picture:  # fmt: skip
    """Take a picture of a world.

    Surfaces are dull (Lambert's law), curved ones shaded smoothly and sharp edges sharp.

    Args:
        world: A World.
        camera: The camera.
        lamp: The light; None is one above, with shadows.
        background: Colour where nothing is.
        patterns: Chequers of bodies (or names).
        without: Bodies (or names) to leave out.
        instead: Bodies of no world that are drawn in the place of some of the world's and count as them, such as a
            robot's looks in that of its collision shapes; none make it unseen.
        samples: Each pixel's colour is the mean of so many by so many, which smooths edges.
        noise: Standard deviation of each pixel's channels [levels of 255].
        seed: Of the noise.

    Raises:
        UnknownNameError: a body that is not in the world.
        InvalidInputError: a value that cannot be used, or more than a million triangles.
    """
    lamp = Lamp() if lamp is None else lamp
    samples = count("samples", samples)
    number("noise", noise, low=0.0)
    if not hasattr(world, "lock") or not hasattr(world, "bodies"):
        raise InvalidInputError(f"world must be a World, got {type(world).__name__}")
    with world.lock:
        drawn = _Drawn(world, camera, patterns or {}, _hidden(world, without), instead or {})
        time, bodies = world.time, tuple(world.bodies)
    keys = drawn.keys(camera)
    shape = keys.shape
    sampled, sampled_camera = (keys, camera) if samples == 1 else (None, camera.scaled(samples))
    if sampled is None:
        sampled = drawn.keys(sampled_camera)
    rays = _local_rays(*_lens(sampled_camera))
    device = world.device
    turn = wp.mat33(*camera.camera_to_world[:3, :3].ravel().tolist())
    shaded: Any = wp.empty(sampled.shape, dtype=wp.vec3, device=device)
    points = lamp.points()
    total = shaded if len(points) == 1 else wp.zeros(sampled.shape, dtype=wp.vec3, device=device)
    on_device: Any = wp.array(rays, dtype=wp.vec3, device=device)
    for place in points:
        light, shadow = drawn.light(lamp, place, camera, keys, background)
        wp.launch(
            shading.shade, dim=sampled.shape,
            inputs=[
                sampled, shadow, on_device, turn, wp.vec3(*camera.camera_to_world[:3, 3].tolist()), drawn.positions,
                drawn.normals, drawn.local, drawn.faces, drawn.owner, drawn.face_count, drawn.plane_normals,
                drawn.looks, light,
            ],
            outputs=[shaded], device=device,
        )  # fmt: skip
        if total is not shaded:
            share = 1.0 / len(points)
            wp.launch(shading.add, dim=sampled.shape, inputs=[shaded, share], outputs=[total], device=device)
    color: Any = wp.empty((*shape, 3), dtype=wp.uint8, device=device)
    wp.launch(shading.expose, dim=shape, inputs=[total, samples, float(noise), int(seed), color], device=device)
    ids: Any = wp.empty(shape, dtype=wp.int32, device=device)
    wp.launch(shading.to_bodies, dim=shape, inputs=[keys, drawn.owner, drawn.looks.index, ids], device=device)
    depth: Any = raster.depths_of(keys)
    if world.world_count == 1:
        color, depth, ids = color[0], depth[0], ids[0]
    return Picture(camera, time, color, depth, ids, bodies)


class _Drawn:
    """All triangles of a picture, as one mesh on the device."""

    def __init__(
        self, world: Any, camera: Camera, patterns: Mapping[Any, Chequer], hidden: set[int],
        instead: Mapping[Any, Sequence[Any]],
    ) -> None:  # fmt: skip
        self.device, self.worlds = world.device, int(world.world_count)
        chequers = {body_index(world, body): pattern for body, pattern in patterns.items()}
        replaced = {body_index(world, body): others for body, others in instead.items()}
        shown = [
            (k, each) for k, body in enumerate(world.bodies) if k not in hidden for each in replaced.get(k, (body,))
        ]
        solid = [(k, body) for k, body in shown if body.shape.kind != "plane"]
        planes = [(k, body) for k, body in shown if body.shape.kind == "plane"]
        parts = [_surface(body, camera if camera.distortion is not None else None) for _, body in solid]
        starts = np.cumsum([0, *(len(local) for _, _, _, local in parts)])
        faces = [part[2] + start for part, start in zip(parts, starts[:-1], strict=True)]
        self.face_count = sum(len(f) for f in faces)
        if self.face_count + len(planes) > raster.LAST_LABEL:
            raise InvalidInputError(f"a picture has at most {raster.LAST_LABEL} triangles, got {self.face_count}")
        owner = np.repeat(np.arange(len(parts)), [len(f) for f in faces])
        owner = np.concatenate([owner, len(parts) + np.arange(len(planes)), [0]])
        self.positions, self.normals = (self._joined([part[n] for part in parts]) for n in (0, 1))
        self.local = self._array(np.concatenate([part[3] for part in parts] or [np.zeros((1, 3))]), wp.vec3)
        every = np.concatenate(faces) if faces else np.zeros((0, 3))
        self.faces: Any = wp.array(np.ascontiguousarray(every, dtype=np.int32), dtype=wp.vec3i, device=self.device)
        self.owner: Any = wp.array(owner.astype(np.int32), dtype=wp.int32, device=self.device)
        self.planes = [(np.asarray(body.vertices).reshape(-1, *body.vertices.shape[-2:])[0], body.faces)
                       for _, body in planes]  # fmt: skip
        normals = [np.cross(v[f[0][1]] - v[f[0][0]], v[f[0][2]] - v[f[0][0]]) for v, f in self.planes]
        upright = np.array([n / np.linalg.norm(n) for n in normals] or [np.array([0.0, 0.0, 1.0])])
        self.plane_normals = self._array(upright, wp.vec3)
        every_body = [*solid, *planes]
        looks = shading.Looks()
        colors = np.array([linear(rgb(body.color)) for _, body in every_body] or [np.zeros(3)])
        own = [chequers.get(k) for k, _ in every_body]
        others = np.array([linear(rgb(c.color)) if c else np.zeros(3) for c in own] or [np.zeros(3)])
        looks.color, looks.other = self._array(colors, wp.vec3), self._array(others, wp.vec3)
        looks.tile = self._array(
            np.array([number("a chequer's size", c.size, above=0.0) if c else 0.0 for c in own] or [0.0]), wp.float32
        )
        index = np.array([k for k, _ in every_body] or [-1], dtype=np.int32)
        looks.index = wp.array(index, dtype=wp.int32, device=self.device)
        self.looks = looks

    def keys(self, camera: Camera, with_planes: bool = True) -> Any:
        """Return key images (worlds, h, w) with the number of the triangle that is seen."""
        region = Region.full(camera)
        keys = raster.key_images(self.worlds, region, self.device, ids=True)
        if self.face_count:
            raster.draw(keys, self.positions, self.faces, view(camera, region), None)
        if with_planes:
            for k, (vertices, faces) in enumerate(self.planes):
                raster.draw_depth(keys, _depth_of_plane(camera, vertices, faces), self.face_count + k)
        return keys

    def light(self, lamp: Lamp, place: np.ndarray, camera: Camera, keys: Any, background: Any) -> tuple[Any, Any]:
        """Return the lamp as the kernels take it, at a place, and the key images of its shadow map."""
        light = shading.Light()
        light.place = wp.vec3(*place.tolist())
        light.lamp = wp.vec3(*[number("strength", lamp.strength, low=0.0)] * 3)
        light.sky = wp.vec3(*[number("sky", lamp.sky, low=0.0)] * 3)
        light.background = wp.vec3(*linear(rgb(background)).tolist())
        light.slack = SHADOW_SLACK
        shadow = raster.key_images(1, Region(0, 0, 1, 1), self.device, ids=True)
        seen = _seen_points(camera, raster.depths_of(keys).numpy()) if lamp.shadows else np.zeros((0, 3))
        if not len(seen):
            return light, shadow
        rays = seen - place
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        axis = rays.mean(axis=0)
        axis /= np.linalg.norm(axis)
        widest = float(np.arccos(np.clip((rays @ axis).min(), -1.0, 1.0)))
        if not widest < 1.3:
            return light, shadow  # a lamp among what is seen: its map would have to look all around
        side = np.cross(axis, (0.0, 1.0, 0.0) if abs(axis[1]) < 0.9 else (1.0, 0.0, 0.0))
        side /= np.linalg.norm(side)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.stack([side, np.cross(axis, side), axis], axis=1), place
        middle = 0.5 * (SHADOW_PIXELS - 1)
        focal = middle / np.tan(max(widest, 1e-3) * 1.02)
        own = Camera(SHADOW_PIXELS, SHADOW_PIXELS, focal, focal, middle, middle, camera_to_world=pose)
        light.rotation = wp.mat33(*pose[:3, :3].T.ravel().tolist())
        light.focal, light.size = float(focal), SHADOW_PIXELS
        return light, self.keys(own, with_planes=False)  # beneath a floor there is nothing to be shaded by it

    def _joined(self, parts: list[np.ndarray]) -> Any:
        """Vertices (worlds, n) of all parts, whether they are the same in all worlds or not."""
        if not parts:
            return wp.zeros((self.worlds, 1), dtype=wp.vec3, device=self.device)
        same = [np.broadcast_to(part, (self.worlds, *part.shape[-2:])) for part in parts]
        return self._array(np.concatenate(same, axis=1), wp.vec3)

    def _array(self, values: np.ndarray, dtype: Any) -> Any:
        return wp.array(np.ascontiguousarray(values, dtype=np.float32), dtype=dtype, device=self.device)


def _surface(body: Any, camera: Camera | None) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Vertices and their normals (n, 3) or (worlds, n, 3), faces (m, 3), and vertices (n, 3) in the body's frame."""
    if camera is not None and not body.is_dynamic:
        vertices, faces = _split(camera, body.vertices.reshape(-1, *body.vertices.shape[-2:])[0], body.faces)
        return vertices, _normals(vertices, faces), faces, vertices
    still = not body.is_dynamic and not body.is_deformed and all(part.ndim == 1 for part in body.pose())
    if still:
        local, faces = body.shape.mesh()
        turn, place = body.rotation, body.position
        return local @ turn.T + place, _shape_normals(body.shape) @ turn.T, faces, local
    vertices, faces = body.skin()
    rest = body.shape.mesh()[0] if not getattr(body.shape, "is_soft", False) else None
    local = vertices.reshape(-1, *vertices.shape[-2:])[0] if rest is None or len(rest) != vertices.shape[-2] else rest
    each = vertices.reshape(-1, *vertices.shape[-2:])
    normals = np.stack([_normals(v, faces) for v in each])
    return vertices, normals if vertices.ndim == 3 else normals[0], faces, local


@lru_cache(maxsize=512)
def _shape_normals(shape: Shape) -> np.ndarray:
    return _normals(*shape.mesh())


def _normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return unit normals (n, 3) of vertices (n, 3): those of their faces (m, 3), by the faces' angles at them.

    By area instead, that of a box's corner would depend on how its sides are cut into triangles.
    """
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across = _unit(across)
    total = np.zeros_like(vertices)
    for k in range(3):
        ahead, back = (_unit(corners[:, (k + n) % 3] - corners[:, k]) for n in (1, 2))
        angle = np.arccos(np.clip(np.einsum("ij,ij->i", ahead, back), -1.0, 1.0))
        for axis in range(3):
            total[:, axis] += np.bincount(faces[:, k], angle * across[:, axis], minlength=len(vertices))
    return _unit(total)


def _unit(vectors: np.ndarray) -> np.ndarray:
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, size, out=np.zeros_like(vectors), where=size > 0.0)


def _lens(camera: Camera) -> tuple[Any, ...]:
    """Return what a camera's rays in its own frame depend on."""
    bent = None if camera.distortion is None else tuple(camera.distortion.tolist())
    return camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, bent


@lru_cache(maxsize=8)
def _local_rays(
    width: int, height: int, fx: float, fy: float, cx: float, cy: float, bent: tuple[float, ...] | None
) -> np.ndarray:
    """Rays (h, w, 3) float32 of all pixels in the camera's frame, one metre deep, read-only."""
    v, u = np.mgrid[0:height, 0:width]
    own = Camera(width, height, fx, fy, cx, cy, distortion=None if bent is None else np.array(bent))
    rays = own.rays(np.stack([u, v], axis=-1).astype(float)).astype(np.float32)
    rays.setflags(write=False)
    return rays


def _depth_of_plane(camera: Camera, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Depth (h, w) [m] of the endless plane through a mesh's first face; inf beyond the horizon."""
    a, b, c = vertices[np.asarray(faces)[0]].astype(float)
    normal = np.cross(b - a, c - a)
    pose = camera.camera_to_world
    towards = _local_rays(*_lens(camera)) @ (normal @ pose[:3, :3]).astype(np.float32)
    with np.errstate(divide="ignore"):
        depth = np.float32((a - pose[:3, 3]) @ normal) / towards
    return np.where(depth > 0.0, depth, np.inf)


def _seen_points(camera: Camera, depth: np.ndarray) -> np.ndarray:
    """Points (k, 3) [m] of some of the pixels of depth images (worlds, h, w)."""
    step = max(1, camera.width // 64)
    some = depth[:, ::step, ::step]
    rays = _local_rays(*_lens(camera))[::step, ::step] @ camera.camera_to_world[:3, :3].T
    world, row, column = np.nonzero(np.isfinite(some) & (some < 20.0))  # [m] far floors are too large for one map
    return camera.camera_to_world[:3, 3] + rays[row, column] * some[world, row, column, None]
