"""Orders: what pages ask a viewer to do, done on a thread of its own."""

from __future__ import annotations

import json
import logging
import math
import queue
import threading
import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from nuno.bodies.body import Body
from nuno.errors import InvalidInputError, NunoError, UnknownNameError
from nuno.viewer.controls import Controls
from nuno.viewer.picked import PLOTTED
from nuno.viewer.style import Style

if TYPE_CHECKING:
    from nuno.materials import Material

logger = logging.getLogger(__name__)


class Orders(Controls):
    """A world that is followed and controlled, which obeys its pages."""

    def __init__(self, *arguments: Any) -> None:
        self._materials: dict[str, Material] = {}  # of bodies that a page detached
        self._orders: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._worker: threading.Thread | None = None
        super().__init__(*arguments)

    def close(self) -> None:
        """End the page and the looking; the world goes on, also a paused one. Nothing where it was closed before."""
        super().close()
        self._orders.put(None)

    def _hear(self, message: str) -> None:
        try:
            order = json.loads(message)
        except ValueError:
            order = None
        if not isinstance(order, dict):
            logger.warning("the viewer's page said something that is no command: %.80r", message)
            return
        if self._worker is None:
            self._worker = threading.Thread(
                target=_serve, args=(weakref.ref(self), self._orders), name="nuno-viewer-controls", daemon=True
            )
            self._worker.start()
        self._orders.put(order)

    def _serve_order(self, order: dict[str, Any]) -> None:
        try:
            self._obey(order)
            self.update()
        except Exception as error:  # the page is told, and goes on
            if self._stop.is_set():
                return
            if isinstance(error, NunoError):
                logger.warning("the page asked for %r: %s", order, error)
            else:
                logger.exception("the page asked for %r", order)
            with self._turn:
                self._notices.append(str(error))
                self._send([])

    def _obey(self, order: dict[str, Any]) -> None:
        orders: dict[str, Callable[[], None]] = {
            "pause": self.pause, "resume": self.resume, "step": self.step, "reset": self.reset,
            "speed": lambda: self._set_speed(order.get("factor")), "pick": lambda: self._pick_object(order.get("id")),
            "attach": self._attach_picked, "detach": self._detach_picked, "show": lambda: self._show_marks(order),
            "worlds": lambda: self.look_at(order.get("worlds")), "color": lambda: self._color_picked(order.get("by")),
            "plot": lambda: self._plot_picked(order.get("value")),
            "remove plot": lambda: self.remove_plot(str(order.get("name"))),
        }  # fmt: skip
        name = order.get("do")
        if not isinstance(name, str) or name not in orders:
            raise UnknownNameError("command", str(name), list(orders))
        orders[name]()

    def _set_speed(self, factor: Any) -> None:
        self.speed = None if factor == "own" else math.inf if factor == "max" else factor

    def _pick_object(self, identity: Any) -> None:
        found = self._scene.body_of(identity)
        if found is None:
            self.pick(None)
        else:
            self.pick(found[0], world=found[1])

    def _picked_body(self) -> Body:
        body = None if self._picked is None else self.world._bodies.get(self._picked[0])
        if body is None:
            raise InvalidInputError("no body is picked; click on one first")
        return body

    def _attach_picked(self) -> None:
        body = self._picked_body()
        self.world.attach(body, self._materials.pop(body.key, None))

    def _detach_picked(self) -> None:
        body = self._picked_body()
        material = body.material
        self.world.detach(body)
        if material is not None:
            self._materials[body.key] = material

    def _show_marks(self, order: dict[str, Any]) -> None:
        what, on = order.get("what"), bool(order.get("on"))
        shown = self._marks_shown()
        if what not in shown:
            raise UnknownNameError("mark", str(what), list(shown))
        setattr(self._styles, what.replace(" ", "_"), on)

    def _color_picked(self, quantity: Any) -> None:
        body = self._picked_body()
        style = replace(self._styles.of(body), color_by=quantity, color_range=None)
        self._restyle(body, style)

    def _restyle(self, body: Body | str, style: Style) -> None:
        with self.world.lock:
            own = self.world._own(body)
            style.check(own)
        self._styles.own[own.key] = style

    def _plot_picked(self, value: Any) -> None:
        body = self._picked_body()
        if value not in PLOTTED:
            raise UnknownNameError("value", str(value), list(PLOTTED))
        assert self._picked is not None
        unit, read = PLOTTED[value]
        world, index = self.world, self._picked[1]
        name = f"{body.name}: {value}" + (f", world {index}" if world.world_count > 1 else "")
        self.plot(name, lambda: read(world, body, index), unit)


def _serve(reference: weakref.ref[Orders], orders: queue.SimpleQueue[dict[str, Any] | None]) -> None:
    """Do what pages ask for until the viewer is closed or dropped."""
    while (order := orders.get()) is not None:
        viewer = reference()
        if viewer is None:
            return
        viewer._serve_order(order)
        viewer = None
