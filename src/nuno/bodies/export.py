"""The export of a body's surface, for other programs."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from nuno.bodies.surface_file import write_surface
from nuno.validation import checked

if TYPE_CHECKING:
    from nuno.bodies.body import Body


@checked
def export_body(path: str | os.PathLike[str], body: Body, world: int | None = None) -> None:
    """Write a body's surface as it is now to a mesh file; a file that is there is replaced.

    Coordinates are written as they are, metres and z up, so that ``nuno.mesh(path)`` reads them back in place. (glTF
    calls y up: its viewers show a GLB of one body lying.)

    Args:
        path: Ends with .obj, .ply or .glb.
        body: The body; of a soft one, its skin.
        world: Which world of a batch; None for a single world.

    Raises:
        InvalidInputError: no body, another extension, a batch without ``world``, or out of range.
        FileWriteError: no such folder, a read-only one, a full disk; a file that was there stays as it was.
    """
    write_surface(path, body, world)
