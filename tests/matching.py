"""Whether tetrahedra fit together face to face, for tests of what fills a volume with them."""

import numpy as np

from nuno.mesh.tetrahedra import FACES


def inner_faces_match(tets):
    """Return whether every face belongs to one tetrahedron, or to two that see it from its two sides."""
    faces = tets[:, FACES].reshape(-1, 3).astype(np.int64)
    # Turned so that the smallest index is first, a face is the same in both only if seen from the same side.
    turned = np.take_along_axis(faces, (np.argmin(faces, axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    _, seen = np.unique(turned, axis=0, return_counts=True)
    _, shared = np.unique(np.sort(faces, axis=1), axis=0, return_counts=True)
    return bool(seen.max() == 1 and shared.max() <= 2)
