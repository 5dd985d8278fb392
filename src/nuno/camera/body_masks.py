"""Masks of several bodies at once, by their names, from one rendering."""
# Warp's kernels are Python to a type checker, but not with Python's types
# mypy: disable-error-code="misc, index"

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import warp as wp

from nuno.camera.camera import Camera
from nuno.camera.render import body_index, render_ids

wp.set_module_options({"enable_backward": False})


@wp.kernel
def _where(ids: wp.array3d[wp.int32], index: wp.array1d[wp.int32], masks_out: wp.array4d[wp.bool]):
    """A thread says of one pixel whether one body is seen there."""
    body, world, row, column = wp.tid()
    masks_out[body, world, row, column] = ids[world, row, column] == index[body]


def masks_by_name(ids: Any, scene: Any, bodies: Iterable[Any] = ()) -> dict[str, Any]:
    """Return where each of several bodies is seen.

    Args:
        ids: (h, w) or (worlds, h, w) int32 Warp array, indices in ``scene.bodies``.
        scene: A world or a picture.
        bodies: Some of its bodies, or their names; none named is all.

    Returns:
        By the bodies' names, bool Warp arrays like ``ids``, on its device.

    Raises:
        UnknownNameError: a body that is not there.
    """
    wanted = list(bodies) or list(scene.bodies)
    indices = [body_index(scene, body) for body in wanted]
    names = [str(scene.bodies[k].name) for k in indices]
    if not indices:
        return {}
    batch = ids if ids.ndim == 3 else ids.reshape((1, *ids.shape))
    masks: Any = wp.empty((len(indices), *batch.shape), dtype=wp.bool, device=ids.device)
    table: Any = wp.array(np.array(indices, dtype=np.int32), dtype=wp.int32, device=ids.device)
    wp.launch(_where, dim=masks.shape, inputs=[batch, table, masks], device=ids.device)
    return {name: masks[k].reshape(ids.shape) for k, name in enumerate(names)}


def segment(world: Any, camera: Camera, bodies: Iterable[Any] = ()) -> dict[str, Any]:
    """Return where each of several bodies is seen by a camera, see ``masks_by_name``; the world is drawn once."""
    return masks_by_name(render_ids(world, camera), world, bodies)
