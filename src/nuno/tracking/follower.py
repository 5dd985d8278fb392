"""Following a cloth through images: its physics, and forces from what is seen."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from nuno.bodies.body import Body
from nuno.camera.camera import Camera
from nuno.errors import BodyStateError, ImageError, InvalidInputError
from nuno.materials import Cloth
from nuno.tracking.cloth_colours import ClothColours
from nuno.tracking.cloth_image import depth_of_others, draw_cloth
from nuno.tracking.displacements import DisplacementField, Rim, vertex_normals
from nuno.tracking.evidence import Evidence, weigh
from nuno.tracking.followed import Followed
from nuno.tracking.followed_futures import FollowedFutures
from nuno.tracking.observation import (
    Observation,
    check_depth,
    checked_cameras,
    is_picture,
    observe,
    observe_picture,
)
from nuno.tracking.pixel_grid import PixelGrid
from nuno.tracking.pulling import LEAK, STEADIEST, STEADY, STUCK, gain, limited, phases
from nuno.validation import flag, number
from nuno.world.world import World

logger = logging.getLogger(__name__)

ARGUMENTS = ("time", "seen", "depth", "hidden", "camera")
"""Of an image of a stream."""
SOON = 1e-6
"""[s] Instants so near to each other are one."""
LONGEST = 0.2
"""[s] The span before an image in which forces act; what is before that, after dropped images, goes by physics."""
FARTHEST = 4.0
"""Times ``reach``: how far points may be at last, after a cloth was lost for a while."""
WIDEN = 1.3
"""How much farther a follower that is lost looks at each image."""
MEMORY = 2.0
"""[s] Time in which what images said of the futures falls to 1/e: a cloth's material stays, its luck does not."""
SURER = 1.0
"""Logarithm of how much likelier another future must be than the adopted one to take its place."""
HOPELESS = 12.0
"""Logarithm of how much less likely than the best a future is that is put where that is."""


class Follower:
    """A cloth of a world that is kept in step with images; made by ``nuno.follow``.

    Attributes:
        world: The world.
        body: Its cloth.
        cameras: The cameras.
    """

    def __init__(
        self, world: World, body: Body, cameras: Sequence[Camera], materials: Sequence[Cloth], futures: int,
        reach: float, iterations: int, pixels: int, thorough: bool,
    ) -> None:  # fmt: skip
        self.world, self.body, self.cameras = world, body, tuple(cameras)
        self._iterations, self._pixels, self._reach = iterations, pixels, reach
        self._futures = FollowedFutures(world, body, materials, futures, thorough)
        self._faces = np.asarray(body.shape.mesh()[1])
        self._field = DisplacementField(len(body.vertices), self._faces)
        self._rim = Rim(self._faces)
        corners = np.asarray(body.shape.mesh()[0])[self._faces]
        self._spacing = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).mean())
        self._grids = [PixelGrid.of(camera, body.vertices, pixels) for camera in cameras]
        self._colours: list[ClothColours | None] = [None] * len(cameras)
        self._log = np.zeros(futures)
        self._steady = np.zeros((futures, len(body.vertices), 3))  # [N]
        self._adopted = 0
        self._wider = 1.0  # how much farther than ``reach`` points are looked for
        self._last = -np.inf
        self._warned: set[str] = set()

    def __repr__(self) -> str:
        return f"<follower of {self.body.name!r} at t = {self.world.time:.3f} s, {self._futures.count} futures>"

    @property
    def futures(self) -> World:
        """The batch of futures as it is after the last image, a world of its own."""
        return self._futures.worlds

    @property
    def probabilities(self) -> np.ndarray:
        """(futures,) float, how likely each is by the images of the last seconds."""
        share: np.ndarray = np.exp(self._log - self._log.max())
        return share / share.sum()

    def through(self, frames: Iterable[Any], *, progress: bool | None = None) -> Iterator[Followed]:
        """Follow through a stream, and yield what ``update`` returns of each image.

        Args:
            frames: Of each image a tuple of ``update``'s arguments in their order, (time, seen, depth, hidden), of
                which the last ones may be left out, or a mapping with their names.
            progress: Show a progress bar; None shows one in a terminal after two seconds.

        Raises:
            InvalidInputError: what is neither; and as ``update``.
        """
        if not isinstance(frames, Iterable) or isinstance(frames, str | bytes | Mapping | np.ndarray | set | type):
            raise InvalidInputError(f"frames must be a stream of images, got {type(frames).__name__}")
        if progress is not None:
            flag("progress", progress)
        if isinstance(frames, Sequence):
            if not len(frames):
                raise InvalidInputError("frames must be at least one image")
            for frame in frames:
                _check_frame(frame)
        return self._through(frames, progress)

    def _through(self, frames: Iterable[Any], progress: bool | None) -> Iterator[Followed]:
        from nuno.world.progress import with_bar

        for frame in with_bar(frames, "following", progress) if isinstance(frames, Sequence) else frames:
            _check_frame(frame)
            yield self.update(**frame) if isinstance(frame, Mapping) else self.update(*frame)

    def update(
        self, time: float, seen: Any = None, depth: Any = None, hidden: Any = None, *, camera: Any = None
    ) -> Followed:
        """Let time pass until an image was taken, and bring the cloth to where the image shows it.

        With several cameras each of ``seen``, ``depth`` and ``hidden`` is a sequence, one a camera, None where one has
        nothing to tell.

        Args:
            time: When it was taken [s], by the world's clock.
            seen: Where the cloth is seen, (height, width) bool, as a mask; or the image, (height, width, 3) uint8 RGB,
                in which it is found by the colours that it had in the first one. None is a dropped image: time passes.
            depth: (height, width) [m] along the optical axis; NaN, infinite and 0 are not known. None without.
            hidden: (height, width) bool, where something that the world does not have hides the cloth. Bodies of the
                world, such as the robot's links, are known to hide it, and so is what is nearer by the depth.
            camera: The camera where it was at that time, if it moves; of the same number of pixels.

        Raises:
            InvalidInputError: an earlier time than that of the image before, or one that is no time.
            ImageError: something that does not fit its camera.
            ClothNotFoundError: the first colour image shows too little of the cloth, or of all else, to learn from.
            BodyStateError: the cloth was detached or taken out of its world, or the world runs in the background.
            SimulationDiverged: a state stopped being finite; the world is what it was before.
        """
        when = number("time", time, high=1e9)
        if when < self._last - SOON:
            raise InvalidInputError(
                f"time goes backwards: an image of {when:g} s after one of {self._last:g} s; make another follower "
                "to begin anew"
            )
        self._check_state()
        grids = self._grids if camera is None else self._moved(camera)
        named = {"seen": seen, "depth": depth, "hidden": hidden}
        given = [self._of_cameras(name, value) for name, value in named.items()]
        shown = [self._checked(grid, *parts) for grid, parts in zip(grids, zip(*given, strict=True), strict=True)]
        if when < self.world.time - SOON:
            self._tell("late", f"an image of {when:g} s came when the world was at {self.world.time:g} s already")
            self._last = when
            return self._result(when, False, "late", self._nothing(), np.zeros(()))
        try:
            return self._advance(when, grids, shown)
        except BaseException:
            self._futures.forget()
            raise

    def _advance(self, when: float, grids: list[PixelGrid], shown: list[Any]) -> Followed:
        """Let the futures pass until an image's time, drawn by it, and adopt the likeliest."""
        if not self._futures.bring():
            self._steady[:] = 0.0  # it drew the cloth from where it no more is
        worlds, body = self._futures.worlds, self._futures.body
        before = when - LONGEST
        if before > worlds.time + SOON:
            worlds.run(before - worlds.time, progress=False)
        span = when - worlds.time
        anchor = worlds.save()
        if all(part[0] is None for part in shown):
            self._steady[:] = 0.0
        if span > SOON:
            if self._steady.any():
                worlds.push(body, self._steady, duration=span)
            worlds.run(span, progress=False)
        seen_now = [self._observed(k, grid, *parts) for k, (grid, parts) in enumerate(zip(grids, shown, strict=True))]
        views = [each for each in seen_now if each is not None]
        others = [depth_of_others(worlds, body, each.grid) for each in views]
        evidence = self._weigh(views, others) if views else self._nothing()
        reason = self._reason(views, evidence, span)
        forces = self._steady.copy()
        if reason is None:
            forces, evidence = self._draw(anchor, span, views, others, evidence)
        elif span <= SOON:
            forces = np.zeros_like(forces)
        elif self._steady.any():  # nothing was seen: what drew the cloth before ends
            self._steady[:] = forces[:] = 0.0
            worlds.restore(anchor)
            worlds.run(span, progress=False)
        self._judge(span, evidence if reason in (None, "lost", "instant") else None)
        self._futures.adopt(self._adopted)
        self._last = when
        return self._result(when, reason is None, reason, evidence, forces)

    # What is seen

    def _check_state(self) -> None:
        if self.body not in self.world.bodies:
            raise BodyStateError(f"{self.body.name!r} is no longer in the world that it is followed in")
        if not isinstance(self.body.material, Cloth):
            raise BodyStateError(f"{self.body.name!r} moves as cloth no more; attach it to follow it")
        if self.world.is_running:
            raise BodyStateError("the world runs in the background; stop it, as a follower lets time pass itself")

    def _moved(self, camera: Any) -> list[PixelGrid]:
        cameras = checked_cameras(camera)
        if len(cameras) != len(self.cameras):
            raise InvalidInputError(f"camera must be {len(self.cameras)} as before, got {len(cameras)}")
        grids = []
        for known, moved in zip(self._grids, cameras, strict=True):
            if (moved.width, moved.height) != (known.full.width, known.full.height):
                raise InvalidInputError(f"a camera that moves keeps its pixels, got {moved.width} x {moved.height}")
            grids.append(known if moved is known.full else PixelGrid.every(moved, known.step))
        return grids

    def _of_cameras(self, name: str, value: Any) -> list[Any]:
        if value is None or len(self._grids) == 1:
            return [value] * len(self._grids)
        if not isinstance(value, Sequence) or len(value) != len(self._grids):
            raise ImageError(f"{name} must be a sequence of {len(self._grids)}, one a camera, got {value!r:.60}")
        return list(value)

    def _checked(self, grid: PixelGrid, seen: Any, depth: Any, hidden: Any) -> tuple[Any, Any, Any]:
        """Return what one camera showed, Warp arrays as NumPy's, checked before anything changes."""
        seen, depth, hidden = (part.numpy() if hasattr(part, "numpy") else part for part in (seen, depth, hidden))
        if seen is None:
            if depth is not None:
                check_depth(depth, grid.full)
            return None, None, None
        if is_picture(seen):
            return seen, depth, observe_picture(grid, seen, depth, hidden)
        return seen, depth, observe(grid, seen, depth, hidden)

    def _observed(self, k: int, grid: PixelGrid, seen: Any, depth: Any, known: Any) -> Observation | None:
        """Return what camera ``k`` shows; in an image, by colours, which are learnt of the first one."""
        if seen is None or not is_picture(seen):
            return None if seen is None else known
        reduced = grid.take(np.asarray(seen))
        colours = self._colours[k]
        if colours is None:
            from nuno.camera.regions import grow

            body = self._futures.body
            image = draw_cloth(self._futures.worlds, body, grid, depth_of_others(self._futures.worlds, body, grid))
            own = image[self._adopted]
            colours = ClothColours(reduced, own.seen & ~known.hidden, ~grow(own.faces >= 0, 2))
            self._colours[k] = colours
        return Observation(grid, colours.mask(reduced) & ~known.hidden, known.depth, known.hidden)

    def _nothing(self) -> list[Evidence]:
        return [Evidence.nothing(len(self.body.vertices)) for _ in range(self._futures.count)]

    def _weigh(self, views: list[Observation], others: list[np.ndarray]) -> list[Evidence]:
        """Return what the images say of each future's cloth as it is."""
        found = self._nothing()
        body = self._futures.body
        vertices = np.asarray(body.vertices).reshape(self._futures.count, -1, 3)
        for view, behind in zip(views, others, strict=True):
            drawn = draw_cloth(self._futures.worlds, body, view.grid, behind)
            for k, image in enumerate(drawn):
                weigh(
                    view, image, vertices[k], vertex_normals(vertices[k], self._faces),
                    self._rim.inwards(vertices[k]), self._faces, self._spacing, self._reach * self._wider,
                    found[k],
                )  # fmt: skip
        return found

    def _reason(self, views: list[Observation], evidence: list[Evidence], span: float) -> str | None:
        """Return why the images of ``span`` [s] after the world's time cannot draw the cloth, None where they can."""
        own = evidence[self._adopted]
        if not views:
            return "dropped"
        if all(view.is_empty for view in views):
            if not own.expected:
                return "hidden"
            self._tell("empty", "no pixel shows the cloth, where some should")
            return "empty"
        if not own.common:
            self._tell("lost", "the cloth is seen, but nowhere near where it should be")
            self._wider = min(self._wider * WIDEN, FARTHEST)
            return "lost" if not own.expected else None
        self._wider = 1.0
        if span > SOON:
            return None
        if np.isfinite(self._last):  # a first image of the world's time is as good a beginning as any
            self._tell(
                "instant", "an image of the time at which the world is already draws nothing, for no time passes; "
                "let followers of one world take images of different times, by turns"
            )  # fmt: skip
        return "instant"

    def _tell(self, what: str, text: str) -> None:
        if what not in self._warned:
            self._warned.add(what)
            logger.warning("%r: %s; physics alone moves it meanwhile (said once)", self.body.name, text)

    # What comes of it

    def _draw(
        self, anchor: Any, span: float, views: list[Observation], others: list[np.ndarray], evidence: list[Evidence]
    ) -> tuple[np.ndarray, list[Evidence]]:
        """Go through the span before the image again, with forces by what it says; return these [N] and the rest."""
        worlds, body = self._futures.worlds, self._futures.body
        parts = phases(span, 1.0 / worlds.frame_rate)
        masses = self._futures.masses
        wanted = np.zeros((self._futures.count, masses.shape[1], 3))
        mean = steady = np.where(np.stack([each.visible for each in evidence])[..., None], self._steady, 0.0)
        for _ in range(self._iterations):
            step = np.stack([self._displacements(each) for each in evidence])
            if not step.any():
                break
            wanted = wanted + gain(span) * step
            worlds.restore(anchor)
            mean = np.zeros_like(wanted)
            for duration, acceleration in parts:
                force = limited(steady + acceleration * masses[..., None] * wanted, masses)
                worlds.push(body, force, duration=duration)
                worlds.run(duration, progress=False)
                mean += force * (duration / span)
            evidence = self._weigh(views, others)
        speeds = np.asarray(body.velocities).reshape(wanted.shape)
        for k, each in enumerate(evidence):
            still = np.linalg.norm(speeds[k], axis=1, keepdims=True) < STUCK
            more = STEADY * still * masses[k][:, None] * self._displacements(each) / span**2
            self._steady[k] = limited(np.where(still, LEAK, 0.5) * (steady[k] + more), masses[k], STEADIEST)
            self._steady[k, ~each.visible | self._futures.held] = 0.0
        return mean, evidence

    def _displacements(self, evidence: Evidence) -> np.ndarray:
        """Return by how much the vertices that are seen, and not held, are off: (n, 3) [m]."""
        found = self._field.solve(evidence.information, evidence.residuals)
        found[~evidence.visible | self._futures.held] = 0.0
        return found

    def _judge(self, span: float, evidence: list[Evidence] | None) -> None:
        """Remember how well each future explains the images, and choose the likeliest."""
        if evidence is None or self._futures.count == 1:
            return
        self._log = self._log * np.exp(-max(span, 0.0) / MEMORY) + [each.log_likelihood for each in evidence]
        self._log -= self._log.max()
        best = int(np.argmax(self._log))
        if self._log[best] > self._log[self._adopted] + SURER:
            self._adopted = best
        lost = np.flatnonzero(self._log < -HOPELESS)
        self._futures.follow(lost, best)
        self._steady[lost], self._log[lost] = self._steady[best], -0.5 * HOPELESS

    def _result(
        self, time: float, used: bool, reason: str | None, evidence: list[Evidence], forces: np.ndarray
    ) -> Followed:
        own = evidence[self._adopted]
        vertices = self.body.vertices
        left = np.linalg.norm(self._displacements(own)[own.visible], axis=1)
        seen = own.observed > 0 and own.expected > 0
        return Followed(
            time, vertices, own.visible, used, reason, own.observed, float(left.mean()) if seen else float("nan"),
            own.agreement if own.compared else float("nan"),
            forces[self._adopted] if forces.ndim else np.zeros_like(vertices), self._adopted, self.probabilities,
        )  # fmt: skip


def _check_frame(frame: Any) -> None:
    """Check one image of a stream.

    Raises:
        InvalidInputError: neither a tuple nor a mapping of the arguments of ``Follower.update``.
    """
    named = isinstance(frame, Mapping) and "time" in frame and set(frame) <= set(ARGUMENTS)
    if not named and not (isinstance(frame, tuple | list) and 1 <= len(frame) <= 4):
        raise InvalidInputError(
            f"an image of a stream is (time, seen, depth, hidden) or a mapping of these, got {frame!r:.100}"
        )
    given = frame if named else dict(zip(ARGUMENTS, frame, strict=False))
    number("time", given["time"], high=1e9)
    if isinstance(given.get("seen"), int | float):
        raise InvalidInputError(f"seen must be a mask or an image, got {given['seen']!r}")
