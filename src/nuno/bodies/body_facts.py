"""Facts of a body as notebooks show them, and as a line of its world."""

from __future__ import annotations

import logging
from typing import Any, Protocol

import numpy as np

from nuno.materials import Material
from nuno.shapes.shape import Shape

_log = logging.getLogger(__name__)


class DescribedBody(Protocol):
    """A body as notebooks show it."""

    @property
    def name(self) -> str:
        """Its name, unique in its world."""

    @property
    def shape(self) -> Shape:
        """Its shape."""

    @property
    def position(self) -> np.ndarray:
        """(3,) or (worlds, 3) [m]."""

    @property
    def vertices(self) -> np.ndarray:
        """(n, 3), in a batch (worlds, n, 3) [m]."""

    @property
    def faces(self) -> np.ndarray:
        """(m, 3) int."""

    @property
    def material(self) -> Material | None:
        """The material of its dynamics."""

    @property
    def mass(self) -> Any:
        """[kg], a number or (worlds,)."""


def body_facts(body: DescribedBody) -> list[tuple[str, str]]:
    """Return names and values of what a body is now, to be read: its shape, place, mesh and material."""
    material = body.material
    found = [
        ("shape", body.shape.kind),
        ("position", place_text(body)),
        ("mesh", f"{np.shape(body.vertices)[-2]} vertices, {len(body.faces)} triangles"),
        ("state", "static" if material is None else f"dynamic: {type(material).__name__}"),
    ]
    if material is not None:
        mass = np.atleast_1d(body.mass)
        span = f"{mass.min():.4g}" if np.ptp(mass) == 0.0 else f"{mass.min():.4g} to {mass.max():.4g}"
        found.append(("mass", f"{span} kg"))
    return found


def place_text(body: DescribedBody) -> str:
    """Return where a body is [m], or in how many worlds."""
    place = np.asarray(body.position)
    return f"{millimetres(place)} m" if place.ndim == 1 else f"in {len(place)} worlds"


def millimetres(place: np.ndarray) -> str:
    """Return coordinates as text, to the millimetre."""
    return "(" + ", ".join(f"{value:.3f}" for value in np.round(place, 3) + 0.0) + ")"


def warn_of_double(body: DescribedBody, other: DescribedBody, name: str) -> None:
    """Tell of a body that gets another name, as ``other`` has its own, and is in the same place with the same shape."""
    if body.shape.kind == other.shape.kind and np.array_equal(body.vertices, other.vertices):
        _log.warning(
            "there is %r in the same place already, so this one is added as %r and the two overlap. If a program or a "
            "notebook's cell runs again, let it begin with a new nuno.World(), or world.remove the first",
            other.name, name,
        )  # fmt: skip
