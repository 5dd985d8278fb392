"""MJCF files as scenes, by MuJoCo's own parser and compiler (the extra ``mujoco``)."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

from nuno.errors import FileFormatError, MissingPackageError
from nuno.scenes.compiled_mjcf import CompiledMjcf, names_of
from nuno.scenes.mjcf_constraints import add_constraints
from nuno.scenes.mjcf_flexes import add_flexes
from nuno.scenes.mjcf_shapes import add_static, moving_body
from nuno.scenes.mjcf_tree import add_joints
from nuno.scenes.nuno_part import read_part
from nuno.scenes.scene_description import SceneDescription

PART = "nuno"
UNDAMPED = "no equality constraints or passive forces"
"""What MuJoCo says of an elastic flex without damping."""
LEFT_OUT = {
    "tendon": "tendons are left out", "sensor": "sensors are left out", "camera": "cameras are left out",
    "skin": "skins, which are only seen, are left out", "plugin": "plugins are left out",
    "pair": "pairs with their own contact parameters touch as others do",
}  # fmt: skip


def read_mjcf(path: Path, keyframe: str | None = None) -> SceneDescription:
    """Return the scene of an MJCF file.

    Args:
        path: The file.
        keyframe: Name of the key frame whose positions and velocities are taken; None is that of what Nuno saved,
            else the model's initial ones.

    Raises:
        MissingPackageError: MuJoCo is not installed.
        FileFormatError: MuJoCo does not take the file, or there is no such key frame.
    """
    mujoco = mujoco_package()
    try:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            spec = mujoco.MjSpec.from_file(str(path))
            model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise FileFormatError(f"MuJoCo cannot read {str(path)!r}: {' '.join(str(error).split())}") from error
    parts = [str(text.data) for text in spec.texts if text.name == PART]
    compiled = CompiledMjcf(mujoco, spec, model, _key(mujoco, model, keyframe, path, bool(parts)))
    scene = SceneDescription(tuple(float(g) for g in model.opt.gravity))  # type: ignore[arg-type]
    for warning in said:
        message = " ".join(str(warning.message).split())
        if UNDAMPED not in message:
            scene.note("MuJoCo warns", message)
    add_static(scene, compiled)
    for body in compiled.roots:
        scene.bodies.append(moving_body(scene, compiled, body))
    add_joints(scene, compiled)
    add_flexes(scene, compiled)
    add_constraints(scene, compiled)
    for kind, what in LEFT_OUT.items():
        for name in names_of(mujoco, model, kind):
            scene.note(what, name)
    if parts:
        read_part(scene, parts[0])
    return scene


def mujoco_package() -> Any:
    """Return the package.

    Raises:
        MissingPackageError: it is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        raise MissingPackageError("mujoco", "mujoco", "reading MJCF") from error
    return mujoco


def _key(mujoco: Any, model: Any, asked: str | None, path: Path, is_own: bool) -> int:
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_KEY, k) or "" for k in range(model.nkey)]
    if asked is None:
        return names.index(PART) if is_own and PART in names else -1
    if asked not in names:
        valid = ", ".join(name for name in names if name) or "none"
        raise FileFormatError(f"{str(path)!r} has no key frame named {asked!r}; there are: {valid}")
    return names.index(asked)
