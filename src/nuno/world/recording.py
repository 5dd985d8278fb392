"""Recordings: where the vertices of a world's bodies were, frame by frame."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.surface_file import check_extension, one_world
from nuno.errors import BodyStateError, FileFormatError, InvalidInputError, UnknownNameError
from nuno.files.html_table import html_table
from nuno.files.whole_file import file_path, replacing, write_whole
from nuno.mesh.memory_limit import check_host_memory
from nuno.shapes.color import linear, rgb
from nuno.shapes.soft_shape import SoftShape
from nuno.validation import checked, count, finite_array, index_array, instant, number

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.world.world import World

FORMAT, VERSION = "nuno-recording", 1
UNITS = {"length": "m", "time": "s", "up": "+z"}
# What NumPy and JSON raise over a file that is none of theirs, or damaged
UNREADABLE = (
    OSError,
    MemoryError,
    ValueError,
    KeyError,
    TypeError,
    EOFError,
    IndexError,
    AttributeError,
    zipfile.BadZipFile,
)
FRAME_BYTES = 64
"""Of a frame in which nothing moves: its time, and where the bodies' vertices are."""
ARRAYS = ("vertices", "faces", "skin_corners", "skin_weights")


@dataclass(frozen=True, eq=False)
class RecordedBody:
    """One body of a recording.

    Attributes:
        name: Its name.
        color: As of ``Body``.
        vertices: (t, n, 3), or in a batch (t, worlds, n, 3), float64 [m]: the body's vertices at each time; t is 1
            where they never moved.
        faces: (m, 3) int32, the skin's triangles; they name ``vertices``, or embedded points where there are some.
        skin_corners: (k, 4) int32, the vertices among which each embedded point of a soft body lies; or None.
        skin_weights: (k, 4) float64, their weights; or None.
    """

    name: str
    color: Any
    vertices: np.ndarray
    faces: np.ndarray
    skin_corners: np.ndarray | None = None
    skin_weights: np.ndarray | None = None

    def skin(self) -> np.ndarray:
        """Return the vertices of the surface that is drawn, shaped as ``vertices`` [m]."""
        if self.skin_corners is None or self.skin_weights is None:
            return self.vertices
        return np.einsum("kc,...kcx->...kx", self.skin_weights, self.vertices[..., self.skin_corners, :])


class Recording:
    """The vertices of bodies at several times.

    A recording starts empty; ``add`` takes the present state in, ``Recording.of`` runs a world and records every frame.

    Args:
        world: The world that is recorded.
        bodies: Which of its bodies, or their names; None for all that are in it now.

    Raises:
        UnknownNameError: no body has such a name.
        BodyStateError: a body is not in the world.
        InvalidInputError: there are no bodies.
    """

    def __init__(self, world: World, bodies: Iterable[Body | str] | None = None) -> None:
        if not hasattr(world, "_own"):
            raise InvalidInputError(f"a recording needs a World, got {type(world).__name__}")
        if isinstance(bodies, str) or not isinstance(bodies, Iterable | None):
            raise InvalidInputError(f"bodies must be a sequence of bodies or names, or None, got {bodies!r}")
        chosen = list(world.bodies) if bodies is None else [world._own(body) for body in bodies]
        if not chosen:
            raise InvalidInputError("a recording needs at least one body")
        self._world: World | None = world
        self._bodies = chosen
        self._times: list[float] = []
        self._frames: list[list[np.ndarray]] = [[] for _ in chosen]
        self._loaded: tuple[RecordedBody, ...] = ()

    @classmethod
    @checked
    def of(cls, world: World, seconds: float, bodies: Iterable[Body | str] | None = None) -> Recording:
        """Run a world and return a recording of how it is now and after each frame.

        Args:
            world: The world.
            seconds: How long it runs [s]; the last frame may be shorter.
            bodies: Which bodies, or their names; None for all.

        Raises:
            InvalidInputError: ``seconds`` is no time, or would set the clock beyond 1e9 s.
            NotEnoughMemoryError: so many frames of the dynamic bodies have no room.
        """
        recording = cls(world, bodies)
        begin, span = world.time, number("seconds", seconds, low=0.0)
        instant("seconds", begin + span)
        frames = span * world.frame_rate
        each = sum(body.vertices.nbytes for body in recording._bodies if body.is_dynamic) + FRAME_BYTES
        check_host_memory(
            f"a recording of {frames:.0f} frames", int(frames * each), "record less time, or fewer bodies"
        )
        recording.add()
        for k in range(1, int(np.ceil(frames - 1e-6)) + 1):
            world.run(begin + min(k, frames) / world.frame_rate - world.time)
            recording.add()
        return recording

    @classmethod
    @checked
    def from_frames(cls, times: ArrayLike, bodies: Iterable[RecordedBody]) -> Recording:
        """Return a recording of frames that are known, without a world.

        Args:
            times: (t,) [s], increasing.
            bodies: What moved; their vertices have as many frames as there are times, or one.

        Raises:
            InvalidInputError: times that do not increase, no body, or another number of frames.
        """
        moments = finite_array("times", times, ("t",))
        chosen = tuple(bodies)
        if not chosen or (np.diff(moments) <= 0.0).any():
            raise InvalidInputError("a recording needs at least one body, and times that increase")
        for body in chosen:
            if len(body.vertices) not in (1, len(moments)):
                raise InvalidInputError(f"{body.name!r} has {len(body.vertices)} frames for {len(moments)} times")
        recording = cls.__new__(cls)
        recording._world, recording._bodies, recording._frames = None, [], []
        recording._times, recording._loaded = moments.tolist(), chosen
        return recording

    def __len__(self) -> int:
        return len(self._times)

    def __repr__(self) -> str:
        return f"<Recording of {len(self._times)} frames, {', '.join(body.name for body in self.bodies)}>"

    def _repr_html_(self) -> str:
        span = f", t = {self._times[0]:.3f} to {self._times[-1]:.3f} s" if self._times else ""
        rows = []
        for body in self.bodies if self._times else ():
            moves = np.ptp(body.vertices, axis=0).any()
            rows.append((body.name, body.vertices.shape[-2], len(body.faces), "yes" if moves else "no"))
        columns = ("body", "vertices", "triangles", "moves")
        return html_table(f"Recording of {len(self._times)} frames{span}", rows, columns=columns if rows else ())

    def __getitem__(self, name: str) -> RecordedBody:
        found = next((body for body in self.bodies if body.name == name), None)
        if found is None:
            raise UnknownNameError("recorded body", name, [body.name for body in self.bodies])
        return found

    @property
    def times(self) -> np.ndarray:
        """(t,) float64 [s], the world's clock at each frame."""
        return np.array(self._times)

    @property
    def bodies(self) -> tuple[RecordedBody, ...]:
        """The bodies, with all frames so far."""
        if self._world is None:
            return self._loaded
        return tuple(_recorded(body, frames) for body, frames in zip(self._bodies, self._frames, strict=True))

    def add(self) -> None:
        """Take the present state in.

        Raises:
            BodyStateError: the recording was loaded, or the world's time is not later than that of the last frame.
        """
        if self._world is None:
            raise BodyStateError("a recording that was loaded has no world to record")
        with self._world.lock:
            if self._times and self._world.time <= self._times[-1]:
                raise BodyStateError(
                    f"the world is at t = {self._world.time:.4f} s, the last frame is from {self._times[-1]:.4f} s; a "
                    "frame must be later than those before"
                )
            now = [body.vertices for body in self._bodies]
            for body, frames, vertices in zip(self._bodies, self._frames, now, strict=True):
                if frames and frames[0].shape != vertices.shape:
                    raise BodyStateError(
                        f"{body.name!r} had vertices {frames[0].shape} and now has {vertices.shape}; start a new "
                        "recording"
                    )
            for frames, vertices in zip(self._frames, now, strict=True):
                still = bool(frames) and np.array_equal(frames[-1], vertices)
                frames.append(frames[-1] if still else vertices)
            self._times.append(self._world.time)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the recording as .npz (no pickle), for ``Recording.load``; a file that is there is replaced.

        Raises:
            InvalidInputError: the recording is empty, or the path does not end with .npz.
            FileWriteError: no such folder, a read-only one, a full disk; a file that was there stays as it was.
        """
        goal = self._goal(path, ".npz")
        arrays: dict[str, np.ndarray] = {"times": self.times}
        bodies = []
        for k, body in enumerate(self.bodies):
            color = body.color if isinstance(body.color, str) else [float(value) for value in body.color]
            bodies.append({"name": body.name, "color": color, "embedded": body.skin_corners is not None})
            arrays |= {f"vertices_{k}": body.vertices, f"faces_{k}": body.faces}
            if body.skin_corners is not None and body.skin_weights is not None:
                arrays |= {f"skin_corners_{k}": body.skin_corners, f"skin_weights_{k}": body.skin_weights}
        header = json.dumps({"format": FORMAT, "version": VERSION, "units": UNITS, "bodies": bodies})
        with replacing(goal) as partial, open(partial, "wb") as stream:
            np.savez_compressed(stream, header=np.array(header), **arrays)  # type: ignore[arg-type]

    @checked
    def export(self, path: str | os.PathLike[str], *, world: int | None = None, every: int = 1) -> None:
        """Write the recording as an animation, .glb, that other programs show; a file that is there is replaced.

        Every frame is a morph target of its mesh; z up is turned to glTF's y up.

        Args:
            path: Ends with .glb.
            world: Which world of a batch; None for a single world.
            every: Take every so many frames, from the first.

        Raises:
            InvalidInputError: the recording is empty, the path does not end with .glb, or a batch without ``world``.
            FileWriteError: no such folder, a read-only one, a full disk; a file that was there stays as it was.
        """
        from nuno.files.glb import MovingMesh, glb_bytes

        goal = self._goal(path, ".glb")
        step = count("every", every)
        meshes = [
            MovingMesh(body.name, linear(rgb(body.color)), one_world(body.skin(), world, axis=1)[::step], body.faces)
            for body in self.bodies
        ]
        written = glb_bytes(meshes, (self.times - self.times[0])[::step])
        write_whole(goal, written)

    @classmethod
    @checked
    def load(cls, path: str | os.PathLike[str]) -> Recording:
        """Return a recording that ``save`` wrote.

        Raises:
            FileFormatError: no such file, damaged, no recording, or of an unknown or newer format.
        """
        name = os.fspath(path)
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = {key: file[key] for key in file.files}
            header = json.loads(str(arrays["header"][()]))
            made = (header["format"], header["version"])
        except UNREADABLE as error:
            why = "it is no .npz file" if "allow_pickle" in str(error) else error  # numpy advises to load it unsafely
            raise FileFormatError(f"cannot read {name!r} as a recording: {why}") from error
        if made != (FORMAT, VERSION):
            raise FileFormatError(
                f"{name!r} is of the format {made[0]!r} {made[1]!r}; this version of nuno reads {FORMAT!r} {VERSION}"
            )
        recording = cls.__new__(cls)
        recording._world, recording._bodies, recording._frames = None, [], []
        try:
            recording._times = finite_array("times", arrays["times"], ("t",)).tolist()
            frames = len(recording._times)
            recording._loaded = tuple(
                _read(body, {key: arrays.get(f"{key}_{k}") for key in ARRAYS}, frames)
                for k, body in enumerate(header["bodies"])
            )
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(f"{name!r} is damaged: {error}") from error
        return recording

    def _goal(self, path: str | os.PathLike[str], extension: str) -> FilePath:
        goal = file_path(path)
        check_extension(goal, extension)
        if not self._times:
            raise InvalidInputError("the recording is empty; add a frame first")
        return goal


def _recorded(body: Body, frames: list[np.ndarray]) -> RecordedBody:
    still = all(frame is frames[0] for frame in frames)
    vertices = np.stack(frames[:1] if still else frames) if frames else np.empty((0, *body.vertices.shape))
    if not isinstance(body.shape, SoftShape):
        return RecordedBody(body.name, body.color, vertices, body.faces)
    made = body.shape.tetrahedra()
    corners = None if made.skin_tets is None else made.tets[made.skin_tets]
    return RecordedBody(body.name, body.color, vertices, made.faces, corners, made.skin_weights)


def _read(header: dict[str, Any], arrays: dict[str, np.ndarray | None], frames: int) -> RecordedBody:
    vertices = finite_array("vertices", arrays["vertices"], ("t", "n", 3), ("t", "worlds", "n", 3))
    if len(vertices) not in (1, frames):
        raise ValueError(f"{header['name']!r} has {len(vertices)} frames of {frames}")
    corners, weights = None, None
    drawn = vertices.shape[-2]
    if header["embedded"]:
        corners = index_array("skin_corners", arrays["skin_corners"], ("k", 4), low=0, high=drawn)
        drawn = len(corners)
        weights = finite_array("skin_weights", arrays["skin_weights"], (drawn, 4))
    faces = index_array("faces", arrays["faces"], ("m", 3), low=0, high=drawn)
    color = header["color"] if isinstance(header["color"], str) else tuple(header["color"])
    return RecordedBody(header["name"], color, vertices, faces, corners, weights)
