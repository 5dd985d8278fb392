"""Facts of a body as notebooks show them, and as a line of its world."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from nuno.bodies.body import Body


def body_facts(body: Body) -> list[tuple[str, str]]:
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


def place_text(body: Body) -> str:
    """Return where a body is [m], or in how many worlds."""
    place = np.asarray(body.position)
    return f"{millimetres(place)} m" if place.ndim == 1 else f"in {len(place)} worlds"


def millimetres(place: np.ndarray) -> str:
    """Return coordinates as text, to the millimetre."""
    return "(" + ", ".join(f"{value:.3f}" for value in np.round(place, 3) + 0.0) + ")"
