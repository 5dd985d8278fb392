"""Picks of a cloth that is no rectangle: an L that the engine itself lifts, on other triangles than the estimator's."""

import numpy as np
import pytest

import nuno
from nuno import InvalidInputError
from nuno.camera.cloth_outline import ClothOutline
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation
from nuno.mesh.triangulated import triangulate

TOP = 0.72  # [m] height of the table top
REST_HEIGHT = 0.0025  # [m]
L = np.array([(0.0, 0.0), (0.42, 0.0), (0.42, 0.14), (0.14, 0.14), (0.14, 0.36), (0.0, 0.36)]) - (0.15, 0.15)  # [m]
QUICK = Discretisation(15, 12, HYPOTHESES[1::4])
SPACING = 0.12  # [m]


@pytest.fixture(scope="module")
def seen():
    """What is seen before and after the outer corner of the long arm was lifted, and where that corner was."""
    camera = nuno.Camera.look_at((-0.85, 0.1, TOP + 0.65), (0.05, 0.0, TOP + 0.1), fov=0.85, width=320, height=240)
    world = nuno.World(device="cpu", substeps=18)
    world.add(nuno.plane(name="table", position=(0, 0, TOP)))
    points, faces, _ = triangulate(L, 0.028)
    cloth = world.add(nuno.cloth_mesh(np.pad(points, ((0, 0), (0, 1)), constant_values=TOP + REST_HEIGHT), faces))
    before = world.masks(camera, cloth).numpy()
    world.attach(cloth, nuno.Cloth(bending_rigidity=1e-4, area_density=0.2, thickness=2 * REST_HEIGHT))
    corner = int(np.linalg.norm(points - L[1], axis=1).argmin())
    start = cloth.vertices[corner]
    hand = start + np.array((-0.03, 0.04, 0.32))
    world.grip(cloth, [corner], to=nuno.Path([0.0, 1.5], [start, hand], interpolation="minimum_jerk"))
    world.run(3.0)
    return camera, before, world.masks(camera, cloth).numpy(), start, hand


def estimate(seen, **changes):
    """The estimate from masks."""
    camera, before, after, _, hand = seen
    given = dict(
        camera=camera, table_height=TOP, hand=hand, before_mask=before, after_mask=after, discretisations=[QUICK],
        spacing=SPACING, device="cpu", progress=False,
    )  # fmt: skip
    return nuno.estimate_pick(None, None, **(given | changes))


@pytest.mark.long
def test_the_corner_of_an_l_is_found(seen, tmp_path):
    """The best candidate is the corner that was lifted, within a cell; it is told as a position on the cloth [m]."""
    result = estimate(seen)
    cloth = result.rectangle
    assert isinstance(cloth, ClothOutline) and result.by_position
    assert any("no rectangle" in warning for warning in result.warnings)
    places = cloth.world_positions(result.fractions)
    away = np.linalg.norm(places - seen[3], axis=1)
    assert away.min() < 0.02 and result.order[0] == away.argmin()  # cells are 2.7 cm, a pixel is 5 mm
    np.testing.assert_allclose(result.best, result.labels[result.order[0]])
    # adopted, the held point is where the hand is, and the cloth is as large as what was seen
    body = result.adopt().find("cloth")
    assert np.linalg.norm(body.vertices - seen[4], axis=1).min() < 0.02
    told = result.to_dict()
    assert told["labels"] == "position_m" and told["pick"] == list(result.best)
    assert told["cloth"]["area_m2"] == pytest.approx(0.42 * 0.14 + 0.14 * 0.22, rel=0.04)  # 0.0896 m2, to a pixel's rim
    result.save(tmp_path)
    assert (tmp_path / "result.png").stat().st_size > 10_000


def test_what_does_not_go_together_is_refused(seen):
    """A shape that there is not, a spacing that is none, or one for a rectangle; a rectangle that is none."""
    for wrong in ({"shape": "round"}, {"spacing": -1.0}, {"spacing": "wide"}, {"spacing": 0.003}):
        with pytest.raises((InvalidInputError, nuno.UnknownNameError)):
            estimate(seen, **wrong)
    with pytest.raises(nuno.EstimationError, match="rectangle"):
        estimate(seen, shape="rectangle")
