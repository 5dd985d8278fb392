"""Parameters of a test of which the default run takes a few, that stand for the others; `.ci/run` takes all."""

import pytest


def few(values, *short):
    """Return parameters for ``pytest.mark.parametrize``, all but ``short`` of them marked long."""
    assert all(any(value == each for each in values) for value in short)
    return [value if value in short else pytest.param(value, marks=pytest.mark.long) for value in values]
