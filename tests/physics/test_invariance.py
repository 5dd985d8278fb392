"""Where a cloth is, and how it is turned, does not matter."""

import numpy as np
import pytest
from triangles import rectangle
from world_with import GRAVITY, attached

import nuno
from few_variants import few
from nuno.shapes import quaternion as quat


def swung(shift=(0.0, 0.0, 0.0), turn=(1.0, 0.0, 0.0, 0.0), kind="sheet", seconds=1.0):
    """Return where a cloth's vertices are (n, 3) [m], relative to ``shift``, once it swung down from two corners.

    ``turn`` (w, x, y, z) turns the cloth, the ball that it meets and gravity.
    """
    shift, turn = np.array(shift), np.array(turn)
    side = 0.24
    if kind == "sheet":
        cloth = nuno.sheet((side, side), cells=(10, 10), position=shift, quaternion=turn)
    else:
        points, faces = rectangle(kind, (side, side), side / 10)
        flat = np.column_stack([points - 0.5 * side, np.zeros(len(points))])
        cloth = nuno.cloth_mesh(quat.rotate(turn, flat) + shift, faces, points)
    ball = nuno.sphere(0.05, position=quat.rotate(turn, np.array([0.02, 0.03, -0.1])) + shift)
    material = nuno.Cloth(bending_rigidity=2e-4, thickness=0.004, damping=1e-3)
    world, body = attached(cloth, material, ball, gravity=tuple(quat.rotate(turn, np.array([0, 0, -GRAVITY]))))
    flat = quat.rotate(quat.inverse(turn), body.vertices - shift)
    corners = [int(np.argmin(np.linalg.norm(flat[:, :2] - c, axis=1))) for c in ([-0.12, -0.12], [0.12, -0.12])]
    for corner in corners:
        world.grip(body, corner, to=body.vertices[corner])
    world.run(seconds)
    return quat.rotate(quat.inverse(turn), body.vertices - shift)


@pytest.mark.parametrize("kind", ["sheet", "right-angled"])
def test_translation_changes_nothing(kind):
    """Invariant, to what float32 leaves of shapes that stand 4 m from the room's origin."""
    here = swung(kind=kind)
    there = swung((2.1, -4.7, 1.3), kind=kind)
    # steps of 5e-7 m there; a nudge of the whole by 1e-6 m has grown to 1e-4 m after the swing of a mesh
    np.testing.assert_allclose(there, here, atol=1e-4)


@pytest.mark.parametrize("kind", ["sheet", "right-angled"])
@pytest.mark.parametrize("angle", few([37.0, 90.0, 180.0], 37.0))
def test_rotation_turns_the_result(kind, angle):
    """Invariant: cloth, ball and gravity turned about a slanted axis give the same motion, turned."""
    axis = np.array([1.0, 2.0, -2.0]) / 3.0
    half = 0.5 * np.radians(angle)
    turned = swung(turn=np.r_[np.cos(half), np.sin(half) * axis], kind=kind)
    np.testing.assert_allclose(turned, swung(kind=kind), atol=1e-4)  # float32 in other directions, as above
