"""Running a world: frame by frame, for some time, through instants, or in the background."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.body import Body
from nuno.dynamics.dynamics import SOON
from nuno.errors import BodyStateError, InvalidInputError
from nuno.mesh.memory_limit import check_host_memory
from nuno.validation import finite_array, flag, function, instant, number
from nuno.world.advancing import Advancing
from nuno.world.background import Background
from nuno.world.progress import with_bar
from nuno.world.simulation import CHUNK, CUDA_CHUNK
from nuno.world.trace import run_traced


class Running(Advancing):
    """A simulation with the verbs of time.

    All may be called while it runs in the background.
    """

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.stop()
        else:
            with suppress(Exception):  # the error that ended the block is the one to see
                self.stop()

    def step(self) -> None:
        """Advance by one frame."""
        with self._change("step"):
            frame = 1.0 / self.frame_rate
        self.run(frame)

    def run(
        self, seconds: float, progress: bool | None = None, *, each_frame: Callable[[float], None] | None = None
    ) -> None:
        """Advance by whole frames and a shorter last one; in the background, sleep until that time has come.

        Args:
            seconds: How long [s] of simulated time.
            progress: Show a progress bar; None shows one in a terminal after two seconds.
            each_frame: Called with the time [s] at the end of each frame, to read the world. What is dynamic is as it
                is then; ``time`` and the bodies that follow paths go on some frames at a time only.

        Raises:
            InvalidInputError: ``seconds`` is no time, or would set the clock beyond 1e9 s (32 years).
            BodyStateError: ``each_frame`` is given for a world that runs in the background, or this or another call
                that changes the world comes from there.
            SimulationDiverged: a state stopped being finite; the world keeps the last good one.
        """
        span = number("seconds", seconds, low=0.0)
        if progress is not None:
            flag("progress", progress)
        if each_frame is not None:
            function("each_frame", each_frame)
        with self._change("run"):
            begin = self._time
            finish = instant("seconds", begin + span)
        if self.is_running:
            if each_frame is not None:
                raise BodyStateError("a world that runs in the background tells no frames; stop it first")
            self._wait_until(finish)
            return
        frames = span * self.frame_rate
        # the poses of what follows a path are laid out for so many frames
        most = CUDA_CHUNK if self._device.startswith("cuda") and not self._kinematic_bodies() else CHUNK
        chunk = min(most, math.gcd(*(watcher.frames for watcher in self._watchers)) or most)
        # drivers are asked frame by frame, or for some at once where nobody watches
        ahead = chunk if self.drivers and not self._watchers else 1
        chunk = 1 if self.drivers else chunk
        pieces = max(1, math.ceil(math.floor(frames + 1e-6) / chunk))
        for piece in with_bar(range(1, pieces + 1), "simulating", progress):
            end = finish if piece == pieces else begin + piece * chunk / self.frame_rate
            while end - self._time > SOON:  # less is no time: the same instant
                # a piece goes no further where the clock was set back meanwhile
                last = min(end, self._time + 2.0 * chunk / self.frame_rate)
                stop = self._pace.next_stop(self._time, last, 1.0 / self.frame_rate)
                with self._call():
                    if stop == end and each_frame is None and ahead > 1:
                        ends = [
                            finish if k == pieces else begin + k * chunk / self.frame_rate
                            for k in range(piece, min(piece + ahead, pieces + 1))
                        ]
                        stop = ends[self._frames_ahead(ends) - 1]
                    if stop - self._time > SOON:
                        self._advance(stop - self._time, stop, each_frame)
            self._raise_background_error()

    def _frames_ahead(self, ends: list[float]) -> int:
        """Return how many of the frames that end at ``ends`` [s] drivers may be asked for at once."""
        count = len(ends) if self._engine.is_builtin else 1
        for driver in self.drivers:
            ahead = getattr(driver, "frames_ahead", None)
            count = 1 if ahead is None or count == 1 else min(count, ahead(self._time, ends[:count]))
        return count

    def trace(self, body: Body | str, times: ArrayLike) -> np.ndarray:
        """Run through many instants, and return where a body's vertices are at each.

        This is ``run`` from one to the next, to the bit. But what is told stays on the device meanwhile, so that on a
        GPU frames follow each other without a wait.

        Args:
            body: A dynamic body.
            times: (k,) [s] of the world's clock, increasing, from now on.

        Returns:
            (k, n, 3), in a batch (k, worlds, n, 3), float32 [m].

        Raises:
            BodyStateError: the body is static, or the world runs in the background.
            InvalidInputError: times that do not increase, that are over, or that the clock does not reach.
            NotEnoughMemoryError: the vertices at all instants have no room.
            SimulationDiverged: a state stopped being finite; the world keeps the last good one.
        """
        with self._change("trace"):
            own = self._own(body)
            if self.is_running:
                raise BodyStateError("a world that runs in the background is not traced; stop it first")
            if not own.is_dynamic:
                raise BodyStateError(f"{own.name!r} is static; attach it before it is traced")
            instants = finite_array("times", times, ("k",))
            if not len(instants) or (np.diff(instants) <= 0.0).any() or instants[0] < self._time - SOON:
                raise InvalidInputError(
                    f"times must be one or more, increasing, from {self._time:g} s on, which is now; got {times!r}"
                )
            instant("times", float(instants[-1]))
            needed = 3 * len(instants) * own.vertices.nbytes // 2  # float32, in pieces and as a whole
            check_host_memory(f"a trace of {len(instants)} instants", needed, "trace fewer at a time")
            found = run_traced(self, own, instants, partial(self.run, progress=False))
        return found[:, 0] if self.world_count == 1 else found

    def start(self, real_time_factor: float = 1.0) -> None:
        """Run in the background, at ``real_time_factor`` times real time (``math.inf``: as fast as possible).

        Raises:
            BodyStateError: the world runs already.
        """
        with self._change("start"):
            if self.is_running:
                raise BodyStateError("the world runs in the background already")
            endless = isinstance(real_time_factor, float) and real_time_factor == math.inf
            factor = math.inf if endless else number("real_time_factor", real_time_factor, above=0.0)
            self._background = Background(self, factor)

    def stop(self) -> None:
        """End the running in the background, after the frame it is in; nothing where it does not run.

        Raises:
            Exception: whatever ended it early, such as ``SimulationDiverged``.
        """
        background = self._background
        if background is not None:
            background.stop()
        self._raise_background_error()
        self._background = None

    def _wait_until(self, end: float) -> None:
        while self._time < end - SOON:
            background = self._background
            self._raise_background_error()
            if background is None or not background.alive:
                return self.run(end - self._time)  # it was stopped while we slept
            background.wait_for_frame()
        return None
