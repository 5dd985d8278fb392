"""Films: what a viewer drew, frame by frame, as one file for any browser."""

from __future__ import annotations

import html
import logging
import math
import os
from dataclasses import dataclass, field
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from nuno.bodies.surface_file import check_extension, one_world
from nuno.errors import BodyStateError, InvalidInputError
from nuno.files.whole_file import file_path, write_whole
from nuno.mesh.primitives import PLANE_HALF
from nuno.shapes.color import rgb
from nuno.validation import checked
from nuno.viewer.message import pack
from nuno.viewer.outline import CREASE, outline
from nuno.viewer.page import film_page
from nuno.viewer.rigid_motion import rigid_motion
from nuno.viewer.scene import Scene
from nuno.viewer.scene_object import SceneObject, light_of
from nuno.viewer.viewpoint import FROM, View

if TYPE_CHECKING:
    from nuno.world.recording import Recording

logger = logging.getLogger(__name__)

STEPS = 65535  # into which the room that a thing's points ever take is divided, each way


@dataclass(eq=False)
class Track:
    """One scene object's way through a film.

    Attributes:
        obj: The scene object.
        first: The frame that it entered at.
        last: The frame that it was gone at, or None.
        frames: Those at which it had moved.
        poses: Where it was then, (7,) each; or, of one that deforms or of marks,
        points: its points then, (n, 3) each.
        tints: Frames at which its points had other colours, with these.
    """

    obj: SceneObject
    first: int
    last: int | None = None
    frames: list[int] = field(default_factory=list)
    poses: list[np.ndarray] = field(default_factory=list)
    points: list[np.ndarray] = field(default_factory=list)
    tints: list[tuple[int, np.ndarray | None]] = field(default_factory=list)

    def tint(self, frame: int) -> None:
        """Take the colours of the scene object's points in, from a frame on."""
        self.tints.append((frame, self.obj.colors))

    def add(self, frame: int) -> None:
        """Take the scene object's present state in."""
        self.frames.append(frame)
        if self.obj.pose is not None:
            self.poses.append(self.obj.pose)
        else:
            self.points.append(self.obj.points)

    def content(self) -> dict[str, Any]:
        """Return what the page needs."""
        obj = self.obj
        row: dict[str, Any] = {
            "first": self.first, "last": self.last, "frames": np.array(self.frames, np.uint32),
            "path": obj.path, **{name: _short(value) for name, value in obj.shape.items()},
        }  # fmt: skip
        if self.tints:
            row["tints"] = {
                "frames": np.array([frame for frame, _ in self.tints], np.uint32),
                "colors": [np.empty(0, np.uint8) if colors is None else colors.ravel() for _, colors in self.tints],
            }
        if self.poses:
            return row | {"poses": np.array(self.poses, np.float32).ravel(), **_packed(obj.points[None])}
        if obj.shape["kind"] in ("mesh", "lines"):
            return row | _packed(np.array(self.points))
        counts = np.array([len(points) for points in self.points], np.uint32)
        return row | {"counts": counts, "values": np.concatenate(self.points).astype(np.float32).ravel()}


class Film:
    """A recording of what was drawn of a world; ``Viewer.record`` starts one, ``stop`` ends it.

    With ``with``, it is stopped, and saved where a path was given, at the end of the block.

    Args:
        scene: What is drawn; None where the tracks are known.
        rate: Frames per simulated second [1/s].
        path: Where it is saved at the end of a ``with`` block, or None.

    Raises:
        InvalidInputError: a path that does not end with .html.
    """

    def __init__(self, scene: Scene | None, rate: float = 30.0, path: str | os.PathLike[str] | None = None) -> None:
        if path is not None:
            check_extension(file_path(path), ".html")  # now, not when all is done
        self._scene, self._rate, self._path = scene, rate, path
        self._tracks: dict[int, Track] = {}
        self._times: list[float] = []
        self._failed: Exception | None = None
        self.view: View | None = None
        self.direction = FROM  # from where all is seen, where there is no view
        self.labels: list[tuple[str, Any, float]] = []  # text, where its middle is (3,) and how high it is [m]
        self._period = 1 if scene is None else max(1, int(scene.world.frame_rate / rate + 1e-6))
        if scene is not None:
            with scene.world.lock:
                self._take()
                scene.world._watchers.append(self)

    @classmethod
    @checked
    def of(cls, recording: Recording, *, world: int | None = None) -> Film:
        """Return a film of a recording.

        Args:
            recording: The recording.
            world: Which world of a batch; None for a single world.

        Raises:
            InvalidInputError: the recording is empty, or a batch without ``world``.
        """
        film = cls(None)
        film._times = recording.times.tolist()
        if not film._times:
            raise InvalidInputError("the recording is empty; add a frame first")
        for body in recording.bodies:
            points = one_world(body.skin(), world, axis=1)
            local, poses = rigid_motion(points)
            plane = points.shape[1] == 4 and float(np.ptp(local, axis=0).max()) >= PLANE_HALF  # stands for all of it
            crease = CREASE if poses is not None else None
            lines = np.empty(0, np.uint32) if plane else outline(local, body.faces, crease)
            obj = SceneObject(
                ("recording", body.name), "mesh", local, color=light_of(rgb(body.color)), opacity=1.0, endless=plane,
                triangles=body.faces.astype(np.uint32).ravel(), lines=lines, crease=crease,
            )  # fmt: skip
            track = Track(obj, 0)
            for frame in range(len(points)):
                if poses is not None:
                    obj.place(poses[frame])
                else:
                    obj.shift(points[frame])
                if frame == 0 or obj.moved:
                    track.add(frame)
                obj.moved = False
            film._tracks[obj.number] = track
        return film

    def __enter__(self) -> Film:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
        if kind is None and self._path is not None:
            self.save(self._path)

    def __len__(self) -> int:
        return len(self._times)

    def __repr__(self) -> str:
        return f"<Film of {len(self._times)} frames, {self.duration:.2f} s>"

    def _repr_html_(self) -> str:
        page = html.escape(film_page(self.message(), "Nuno"), quote=True)
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 500px; border: none"></iframe>'

    @property
    def frames(self) -> int:
        """Return the frames of a run that may go by between two calls of ``seen``, so that none is missed."""
        if self._scene is None:
            return self._period
        done = round((self._scene.world._time - self._times[-1]) * self._scene.world.frame_rate)
        return math.gcd(self._period, max(0, self._period - done))

    @property
    def times(self) -> np.ndarray:
        """(t,) float64 [s], the world's clock at each frame."""
        return np.array(self._times)

    @property
    def duration(self) -> float:
        """[s] from the first frame to the last."""
        return self._times[-1] - self._times[0] if self._times else 0.0

    @property
    def is_recording(self) -> bool:
        """Return True if it goes on."""
        return self._scene is not None

    def stop(self) -> None:
        """Take the last frame and end the recording; nothing where it has ended.

        Raises:
            Exception: whatever kept it from taking a frame.
        """
        scene = self._scene
        if scene is None:
            return
        with scene.world.lock:
            self._scene = None
            scene.world._watchers = [other for other in scene.world._watchers if other is not self]
            if self._failed is None and scene.world._time > self._times[-1]:
                self._take(scene)
        if self.view is None:
            self.view = View.around(*scene.bounds())
        if self._failed is not None:
            raise self._failed

    def seen(self) -> None:
        """Take a frame in where one is due; the world calls this under its lock after each piece of a run."""
        if self._scene is None or self._failed is not None:
            return
        now = self._scene.world._time
        try:
            if now >= self._times[-1] + (1.0 - 1e-3) / self._rate:  # where time was set back, later than ever before
                self._take()
        except Exception as error:  # the world must go on; ``stop`` tells
            logger.exception("the recording ended at t = %.3f s", now)
            self._failed = error

    @checked
    def save(self, path: str | os.PathLike[str], title: str = "Nuno") -> None:
        """Write one .html file with all that it needs; a file that is there is replaced.

        Args:
            path: Ends with .html.
            title: The page's title.

        Raises:
            InvalidInputError: the path does not end with .html.
            FileWriteError: no such folder, a read-only one, a full disk; a file that was there stays as it was.
        """
        goal = file_path(path)
        check_extension(goal, ".html")
        written = film_page(self.message(), title).encode()
        write_whole(goal, written)

    def message(self) -> bytes:
        """Return the film as the page takes it.

        Raises:
            BodyStateError: it is still being recorded.
        """
        if self._scene is not None:
            raise BodyStateError("the film is being recorded; stop it first")
        view = self.view or self._view_of_all()
        times = np.array(self._times) - self._times[0]
        content = {
            "do": "film", "start": self._times[0], "times": times.astype(np.float32),
            "tracks": [track.content() for track in self._tracks.values()],
            "labels": [{"text": text, "at": np.array(at).tolist(), "height": high} for text, at, high in self.labels],
        }  # fmt: skip
        return pack({"commands": [view.command(), content]})

    def _take(self, scene: Scene | None = None) -> None:
        scene = scene or self._scene
        assert scene is not None
        scene.look()
        left, entered, moved, recolored = scene.settle()
        frame = len(self._times)
        self._times.append(scene.time)
        for number in left:
            if number in self._tracks:
                self._tracks[number].last = frame
        for obj in entered:
            self._tracks[obj.number] = Track(obj, frame)
        for obj in [*entered, *moved]:
            self._tracks[obj.number].add(frame)
        for obj in [*(obj for obj in entered if obj.colors is not None), *recolored]:
            self._tracks[obj.number].tint(frame)

    def _view_of_all(self) -> View:
        corners = []
        for track in self._tracks.values():
            if track.obj.shape.get("endless"):
                continue
            if track.poses:
                reach = np.abs(track.obj.points).max()
                places = np.array(track.poses)[:, :3]
                corners += [places.min(axis=0) - reach, places.max(axis=0) + reach]
            elif track.points:
                points = np.concatenate(track.points)
                corners += [points.min(axis=0), points.max(axis=0)]
        if not corners:
            return View.around(np.full(3, -0.5), np.full(3, 0.5), self.direction)
        low, high = np.min(corners, axis=0).astype(float), np.max(corners, axis=0).astype(float)
        return View.around(low, high, self.direction)


def _packed(points: np.ndarray) -> dict[str, Any]:
    """Return points (t, n, 3) in whole steps of the room that they take, each frame as the change from that before."""
    low, high = points.min(axis=(0, 1)).astype(float), points.max(axis=(0, 1)).astype(float)
    step = np.maximum(high - low, 1e-9) / STEPS
    whole = np.rint((points - low) / step).astype(np.uint16)
    changes = np.diff(whole, axis=0, prepend=np.zeros_like(whole[:1]))  # modulo 65536, as the page adds
    return {"low": low.tolist(), "step": step.tolist(), "changes": changes.ravel()}


def _short(value: Any) -> Any:
    """Return an array of small numbers in two bytes each."""
    if isinstance(value, np.ndarray) and value.dtype == np.uint32 and (not len(value) or value.max() <= STEPS):
        return value.astype(np.uint16)
    return value
