"""Picks that MuJoCo imagines: the example's answer, by physics that nobody here wrote."""

from dataclasses import replace
from pathlib import Path

import pytest

import nuno
from nuno.estimate.hypotheses import DISCRETISATIONS

pytest.importorskip("mujoco", minversion="4.0")

EXAMPLE = Path(__file__).parents[3] / "examples" / "pick-case"


def test_an_engine_that_there_is_not_is_refused_before_images_are_read():
    """The name is looked at first."""
    case = nuno.read_case(EXAMPLE)
    with pytest.raises(nuno.UnknownNameError):
        case.estimate(engine="odd")


@pytest.mark.long
def test_mujoco_tells_the_same_corner_as_nuno():
    """Both engines say that the example's cloth was picked at the corner (0, 0), on a coarse mesh and one guess."""
    coarse = replace(DISCRETISATIONS[0], cells=8, hypotheses=DISCRETISATIONS[0].hypotheses[:1])
    case = nuno.read_case(EXAMPLE)
    for engine in ("nuno", "mujoco"):
        found = case.estimate(
            candidates=(2, 2), engine=engine, discretisations=[coarse], device="cpu", progress=False
        )  # fmt: skip
        assert found.best == (0, 0)
