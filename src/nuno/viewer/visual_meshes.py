"""The visual meshes that a robot's links are drawn as, while the bodies that touch things are their hulls."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING

from nuno.viewer.body_objects import VisualMesh

if TYPE_CHECKING:
    from nuno.bodies.body import Body
    from nuno.robot.links import Links


class VisualMeshes:
    """Visual meshes that bodies are drawn as, by body key; none for links that are visual meshes already.

    Visual meshes (``nuno.robot.looks``) are drawn in place of all bodies of a robot.

    Args:
        robots: Links whose bodies are in the world as copies; of the others, their bodies tell.
    """

    def __init__(self, robots: Iterable[Links] = ()) -> None:
        self._read: list[Links] = []
        self._garments: dict[str, list[VisualMesh]] = {}
        for links in robots:
            self._take(links)

    def of(self, body: Body) -> list[VisualMesh] | None:
        """Return what to draw in place of a body; None is the body itself.

        Raises:
            MeshError: a visual mesh that cannot be read.
        """
        links = body._links
        if links is not None and not any(links is known for known in self._read):
            self._take(links)
        return self._garments.get(body.key)

    def _take(self, links: Links) -> None:
        self._read.append(links)
        if any(body.group == 0 for body in links.bodies):
            return
        from nuno.robot.looks import looks_of  # which loads Pinocchio

        worn: dict[str, list[VisualMesh]] = {body.key: [] for body in links.bodies}
        names: Counter[str] = Counter()
        for look in looks_of(links):
            shape = look.shape
            names[shape.link] += 1
            name = shape.link if names[shape.link] == 1 else f"{shape.link}_{names[shape.link]}"
            visual_mesh = VisualMesh((links.robot.name, name), shape.shape, look.pose, shape.color)
            worn[links.bodies[look.body].key].append(visual_mesh)
        self._garments |= worn
