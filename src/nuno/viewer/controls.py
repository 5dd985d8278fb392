"""Controls of a viewer: time, the picked body, plots and worlds, from the page or from the program."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterable
from typing import Any

from nuno.bodies.body import Body
from nuno.errors import BodyStateError, InvalidInputError, UnknownNameError
from nuno.validation import checked, count, number
from nuno.viewer.following import Following
from nuno.viewer.picked import PLOTTED, Plot, state_rows
from nuno.viewer.scene import Scene, checked_places
from nuno.viewer.vertex_values import QUANTITIES

logger = logging.getLogger(__name__)

SHARE = 0.05  # of the time that plots and the picked body's state may take
OFTEN = 0.1  # [s] between two samples of them, at least
RUNS = 0.5  # [s] after its last frame for which a world counts as running


class Controls(Following):
    """A world that is followed, and controlled from the pages and the program."""

    def __init__(self, *arguments: Any) -> None:
        self._picked: tuple[str, int] | None = None  # key of a body, and its world
        self._picked_rows: list[tuple[str, str]] = []
        self._plots: dict[str, Plot] = {}
        self._plots_changed = False
        self._samples_due = 0.0
        self._time_before, self._moved_at = math.nan, -math.inf
        self._runs_it = False  # whether a page, or ``resume``, runs the world in the background
        self._notices: list[str] = []
        self._sent_state: dict[str, Any] = {}
        self._can_control = bool(arguments[-1])
        world = arguments[0]
        self._begin = world.save() if self._can_control and not world._telling else None
        super().__init__(*arguments)

    def close(self) -> None:
        """End the page and the looking; the world goes on, also a paused one. Nothing where it was closed before."""
        if not self._stop.is_set():
            self.world._pace.set_factor(None)
            self.world._pace.resume()
            if self._runs_it and self.world.is_running:
                self.world.stop()
        super().close()

    # Time

    @property
    def state(self) -> str:
        """Return "paused", "running" or "still": a still world is one that nobody runs."""
        if self.world._pace.is_paused:
            return "paused"
        moved = time.perf_counter() - self._moved_at < RUNS
        return "running" if moved or self.world.is_running else "still"

    @property
    def speed(self) -> float | None:
        """Simulated over real time, ``inf`` for as fast as possible; None is as the program runs the world."""
        return self.world._pace.factor

    @speed.setter
    def speed(self, factor: float | None) -> None:
        if factor is not None and factor != math.inf:
            factor = number("speed", factor, above=0.0)
        self.world._pace.set_factor(factor)

    def pause(self) -> None:
        """Hold the world up after the frames that it is in; whoever runs it waits until ``resume`` or ``step``.

        That includes ``world.run`` of the program: call ``resume`` from another thread, or from the page. Results do
        not change.

        Raises:
            ViewerError: the viewer is closed.
        """
        self._check_open()
        if self._runs_it and self.world.is_running:
            self._runs_it = False
            self.world.stop()
            self._rest_at(self.world.time)
        else:
            self.world._pace.pause()

    def resume(self) -> None:
        """Let a paused world go on; a world that nobody runs starts to run in the background.

        Raises:
            ViewerError: the viewer is closed.
        """
        self._check_open()
        pace = self.world._pace
        if pace.is_paused:
            pace.resume()
        elif self.state == "still":
            self.world.start(1.0 if pace.factor is None else pace.factor)
            self._runs_it = True

    @checked
    def step(self, frames: int = 1) -> None:
        """Let a paused or still world advance by some frames; a running one is paused first.

        Raises:
            ViewerError: the viewer is closed.
        """
        wanted = count("frames", frames)
        self._check_open()
        pace = self.world._pace
        if self.state == "running":
            self.pause()
        if pace.is_paused and (pace.is_awaited or self.world.is_running):
            pace.let(wanted)
            return
        pace.exempt(True)
        try:
            for _ in range(wanted):
                self.world.step()
        finally:
            pace.exempt(False)
            self._rest_at(self.world.time)

    def reset(self) -> None:
        """Make the world what it was when the viewer was opened.

        Raises:
            BodyStateError: the viewer was opened without control, or in ``each_frame``.
            ViewerError: the viewer is closed.
        """
        self._check_open()
        if self._begin is None:
            raise BodyStateError("the viewer kept no state to go back to; open it with control=True, between two runs")
        self.world.restore(self._begin)
        self._rest_at(self.world.time)
        self.update()

    # Bodies, plots, worlds

    @checked
    def pick(self, body: Body | str | None, *, world: int = 0) -> None:
        """Show a body's name and state in the page, and mark it; None shows no body's.

        Args:
            body: The body, or its name.
            world: Which world of a batch.

        Raises:
            InvalidInputError: no such world.
            ViewerError: the viewer is closed.
        """
        self._check_open()
        index = count("world", world, low=0)
        if index >= self.world.world_count:
            raise InvalidInputError(f"world must be from 0 to {self.world.world_count - 1}, got {world!r}")
        with self.world.lock:
            self._picked = None if body is None else (self.world._own(body).key, index)
        self._samples_due = 0.0

    @checked
    def plot(self, name: str, read: Callable[[], Any], unit: str = "") -> None:
        """Plot a value over the world's time in the page, as often as the world is looked at.

        Args:
            name: What the value is called; another plot of that name is replaced.
            read: Returns the value, a number, such as ``lambda: ball.position[2]``. It is called under the world's
                lock, up to ten times a second, and can only read the world.
            unit: Its unit.

        Raises:
            InvalidInputError: ``read`` cannot be called.
            ViewerError: the viewer is closed.
        """
        self._check_open()
        if not callable(read):
            raise InvalidInputError(f"read must be a function that returns a number, got {type(read).__name__}")
        self._plots = {**self._plots, str(name): Plot(str(name), unit, read)}
        self._samples_due, self._plots_changed = 0.0, True

    @checked
    def remove_plot(self, name: str) -> None:
        """Plot a value no longer.

        Raises:
            UnknownNameError: there is no plot of that name.
        """
        if name not in self._plots:
            raise UnknownNameError("plot", name, list(self._plots))
        self._plots = {other: plot for other, plot in self._plots.items() if other != name}
        self._plots_changed = True

    def look_at(
        self, worlds: int | Iterable[int] | None, *, spacing: float | tuple[float, float] | None = None
    ) -> None:
        """Look at other worlds of a batch.

        Args:
            worlds: Which one, or which ones side by side; None is all, up to nine.
            spacing: [m] between them, along x and y; None is a little more than they need.

        Raises:
            InvalidInputError: no such world.
            ViewerError: the viewer is closed.
        """
        self._check_open()
        with self._turn:
            with self.world.lock:
                self._places = checked_places(self.world, worlds, spacing)
                self._scene = Scene(self.world, self._styles, self._visual_meshes, self._places)
                self._take()
            self._scene.settle()
        self._refresh()

    # Within

    def _rest_at(self, time: float) -> None:
        """Count the world as still, which is at a time [s] that no run has brought it to."""
        self._time_before, self._moved_at = time, -math.inf

    def _take(self, sparing: bool = False) -> None:
        super()._take(sparing)
        now = time.perf_counter()
        if self._scene.time != self._time_before:
            self._moved_at = -math.inf if math.isnan(self._time_before) else now
            self._time_before = self._scene.time
        if (self._plots or self._picked) and (now >= self._samples_due or not sparing):
            self._sample()
            after = time.perf_counter()
            self._samples_due = after + max(OFTEN, (after - now) / SHARE)

    def _sample(self) -> None:
        for name, plot in list(self._plots.items()):
            try:
                self._plots_changed |= plot.sample(self._scene.time)
            except Exception as error:  # the world and the other plots must go on
                logger.warning("the plot %r ended: %s", name, error)
                self._notices.append(f"the plot {name} ended: {error}")
                self._plots = {other: kept for other, kept in self._plots.items() if other != name}
                self._plots_changed = True
        self._picked_rows = []
        if self._picked is not None:
            body = self.world._bodies.get(self._picked[0])
            if body is None:
                self._picked = None
            else:
                self._picked_rows = state_rows(self.world, body, self._picked[1])

    def _news(self, everything: bool = False) -> list[dict[str, Any]]:
        if everything:
            self._sent_state = {}
        factor = self.speed
        rows = {
            "controls": {
                "can": self._can_control, "state": self.state, "marks": self._marks_shown(),
                "speed": "own" if factor is None else "max" if factor == math.inf else factor,
                "worlds": [place.index for place in self._places], "count": self.world.world_count,
            },
            "picked": self._picked_now(),
        }  # fmt: skip
        found = []
        for name, content in rows.items():
            if self._sent_state.get(name) != content:
                self._sent_state[name] = content
                found.append({"do": name, **content})
        if self._plots_changed or (everything and self._plots):
            self._plots_changed = False
            found.append({"do": "plots", "plots": [plot.content() for plot in self._plots.values()]})
        notices, self._notices = self._notices, []
        return found + [{"do": "notice", "text": text} for text in notices]

    def _marks_shown(self) -> dict[str, bool]:
        styles = self._styles
        return {"grips": styles.grips, "contacts": styles.contacts, "grip forces": styles.grip_forces}

    def _picked_now(self) -> dict[str, Any]:
        body = None if self._picked is None else self.world._bodies.get(self._picked[0])
        if self._picked is None or body is None:
            return {"name": None, "ids": []}
        style = self._styles.of(body)
        if body.shape.is_cloth:
            quantities = list(QUANTITIES)
        else:
            quantities = ["strain", "contact"] if body.shape.is_soft else ["contact"]
        return {
            "name": body.name, "ids": self._scene.numbers_of(body, self._picked[1]), "rows": self._picked_rows,
            "dynamic": body.is_dynamic, "color_by": style.color_by, "quantities": quantities,
            "values": list(PLOTTED),
        }  # fmt: skip
