"""Tetrahedra that follow a surface, from fTetWild, an optional package."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from nuno.errors import MeshError, MissingPackageError
from nuno.mesh.tetrahedra import volumes

PURPOSE = 'soft_mesh(tetrahedraliser="pytetwild")'

# One thread: the order in which several work would show in the result.
PROGRAM = """
import numpy, pytetwild
given = numpy.load("surface.npz")
vertices, tets = pytetwild.tetrahedralize(
    given["vertices"], given["faces"], edge_length_abs=float(given["cell"]), num_threads=1
)
numpy.savez("tetrahedra.npz", vertices=vertices, tets=tets)
"""


def fitted_tetrahedra(vertices: np.ndarray, faces: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Return tetrahedra of a closed mesh whose boundary follows it, by fTetWild (Hu et al. 2020).

    It runs as a process of its own, as it leaves files where it runs, and what crashes there ends nothing here. The
    number and order of the tetrahedra may differ between its versions.

    Args:
        vertices: (n, 3) float [m].
        faces: (m, 3) int.
        cell: Length of an edge [m] that is aimed at.

    Returns:
        vertices (k, 3) float64 [m] and tets (t, 4) int32, all of positive volume.

    Raises:
        MissingPackageError: pytetwild, or a package that it needs, is not installed.
        MeshError: nothing came out.
    """
    if find_spec("pytetwild") is None:
        raise MissingPackageError("pytetwild", "tetrahedra", PURPOSE)
    with tempfile.TemporaryDirectory() as folder:
        np.savez(Path(folder) / "surface.npz", vertices=vertices, faces=faces.astype(np.int32), cell=np.array(cell))
        done = subprocess.run([sys.executable, "-c", PROGRAM], cwd=folder, capture_output=True, text=True, check=False)
        last = (done.stderr.strip().splitlines() or [f"it ended with {done.returncode}"])[-1]
        if "ModuleNotFoundError" in last:
            raise MissingPackageError(last.split("'")[1] if "'" in last else last, "tetrahedra", PURPOSE)
        if done.returncode:
            raise MeshError(f"fTetWild could not fill {len(faces)} faces at a cell of {cell:g} m: {last}")
        with np.load(Path(folder) / "tetrahedra.npz") as made:
            points, tets = made["vertices"].astype(np.float64), made["tets"].reshape(-1, 4)
    if not len(tets):
        raise MeshError(f"fTetWild made no tetrahedra of {len(faces)} faces at a cell of {cell:g} m")
    used, renamed = np.unique(tets, return_inverse=True)
    points, tets = points[used], renamed.reshape(-1, 4).astype(np.int32)
    turned = volumes(points, tets) < 0.0
    tets[turned] = tets[turned][:, [0, 1, 3, 2]]
    return points, tets
