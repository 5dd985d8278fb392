"""What the robot itself hides of the image after: it counts neither as cloth nor as background."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import nuno
from nuno.camera.segmentation import segment_after, segment_before
from nuno.camera.table import Table
from nuno.errors import ImageError
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation

CASE = Path(__file__).parents[2] / "examples" / "pick-case"
TRUE = (0, 0)
GREY = (190, 190, 185)


@pytest.fixture(scope="module")
def case():
    """The bundled case."""
    return nuno.read_case(CASE)


@pytest.fixture(scope="module")
def arm(case):
    """An arm (h, w) that comes to the hand from the left, before cloth and table, 44 px wide."""
    u, v = np.meshgrid(np.arange(case.camera.width), np.arange(case.camera.height))
    at = case.camera.project(np.array(case.hand))
    return (np.abs(v - at[1] + 0.3 * (at[0] - u)) < 22) & (u < at[0] + 12)


def covered(image, arm):
    """The image with a grey arm in it."""
    image = image.copy()
    image[arm] = GREY
    return image


def test_arm_is_no_cloth(case, arm):
    """Beside the arm, the cloth that is found is the same as without it, but for 3 % of its pixels."""
    table = Table(case.table_height, case.table_half_extents, case.table_centre, case.table_thickness)
    mask = segment_before(case.before, case.camera, table)
    bare = segment_after(case.after, case.camera, table, case.before, mask, case.hand)
    found = segment_after(
        covered(case.after, arm), case.camera, table, case.before, mask, case.hand, hidden=arm
    )  # fmt: skip
    assert (bare & arm).sum() > 100, "the arm is before the cloth"
    assert not (found & arm).any()
    assert ((found ^ bare) & ~arm).sum() < 0.03 * bare.sum()


@pytest.mark.long
def test_answer_with_an_arm_in_the_image(case, arm):
    """The answer is that without an arm, and hidden pixels are ignored in the comparison."""
    quick = [Discretisation(cells=15, substeps=12, hypotheses=HYPOTHESES[1::2])]
    result = replace(case, after=covered(case.after, arm)).estimate(
        hidden=arm, discretisations=quick, device="cpu", progress=False
    )  # fmt: skip
    assert result.best == TRUE
    half = arm[::2, ::2][: result.real.ignore.shape[0], : result.real.ignore.shape[1]]
    assert result.real.ignore[half].mean() > 0.95, "but for the rim, where a pixel of half the size is half arm"


def test_hidden_must_fit(case):
    """A mask of another size is refused by its name."""
    with pytest.raises(ImageError, match="hidden"):
        case.estimate(hidden=np.zeros((3, 3), dtype=bool), device="cpu")
