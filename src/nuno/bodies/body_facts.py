"""Facts of a body as notebooks show them, and as a line of its world."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from nuno.materials import Material
from nuno.shapes.shape import Shape


class DescribedBody(Protocol):
    """A body as notebooks show it."""

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
