"""Minimisation: known minima, bounds, scales, failures, seeds."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from nuno.errors import EstimationError, InvalidInputError, UnknownNameError
from nuno.search import each, minimise

pytest.importorskip("cma")


def rosenbrock(world, params):
    """Rosenbrock's valley, lowest at (1, 1)."""
    return {"loss": (1.0 - params["x"]) ** 2 + 100.0 * (params["y"] - params["x"] ** 2) ** 2}


def test_rosenbrock():
    """The valley's end is found, and the history tells the way there."""
    found = minimise(rosenbrock, {"x": (-2.0, 2.0), "y": (-1.0, 3.0)}, generations=200, tolerance=1e-6)
    assert found.reason == "tolerance" and found.value == found.tried_values.min() < 1e-8
    assert found.params == pytest.approx({"x": 1.0, "y": 1.0}, abs=1e-4)  # the square root of 1e-8
    assert min(g.best for g in found.history) == found.value == float(found.values["loss"])
    assert len(found.tried["x"]) == len(found.tried_values) == 6 * len(found.history)  # 4 + 3 ln 2 candidates
    assert max(found.history[-1].spread.values()) < 1e-6 < max(found.history[0].spread.values())


def test_one_parameter_on_a_log_scale():
    """Over four orders of magnitude, and stopped when it is good enough."""

    def trial(world, params):
        return {"error": np.log(params["bending"] / 3e-5) ** 2, "twice": 2 * params["bending"]}

    found = minimise(trial, {"bending": (1e-6, 1e-2)}, value="error", log_scale=["bending"], enough=1e-4)
    assert found.reason == "enough" and found.params["bending"] == pytest.approx(3e-5, rel=0.0101)  # exp(sqrt(1e-4))
    assert float(found.values["twice"]) == 2 * found.params["bending"]
    low, high = found.near(0.25)["bending"]
    assert 3e-5 * np.exp(-0.51) <= low <= found.params["bending"] <= high <= 3e-5 * np.exp(0.51)  # sqrt(0.25 + 1e-4)


def test_start_is_tried_first():
    """So that what is found is never worse than it."""
    found = minimise(rosenbrock, {"x": (-2.0, 2.0), "y": (-1.0, 3.0)}, start={"x": 1.0, "y": 1.0}, generations=1)
    # the bounds are shares of the search, so that the start comes back to within rounding
    assert found.params == pytest.approx({"x": 1.0, "y": 1.0}, abs=1e-9) and found.value < 1e-16


def test_minimum_on_a_bound():
    """Nothing outside of the bounds is tried, also where the lowest value lies on one."""
    found = minimise(lambda world, params: {"loss": params["x"] + params["y"]}, {"x": (1.0, 2.0), "y": (-1.0, 1.0)})
    assert found.tried["x"].min() >= 1.0 and found.tried["x"].max() <= 2.0
    assert found.tried["y"].min() >= -1.0 and found.tried["y"].max() <= 1.0
    assert found.params["x"] < 1.01 and found.params["y"] < -0.98  # 1 % of the range


def test_seed():
    """The same seed tries the same, another one something else; NumPy's own generator is left alone."""
    bounds = {"x": (-2.0, 2.0), "y": (-1.0, 3.0)}
    np.random.seed(5)  # noqa: NPY002
    expected = np.random.random()  # noqa: NPY002
    np.random.seed(5)  # noqa: NPY002
    a, b, c = (minimise(rosenbrock, bounds, seed=seed, generations=5) for seed in (0, 0, 1))
    assert a.tried["x"].tolist() == b.tried["x"].tolist() != c.tried["x"].tolist()
    assert np.random.random() == expected  # noqa: NPY002


def test_failures_rank_last():
    """Where half of the ground cannot be walked, the lowest point of the rest is found."""

    def trial(world, params):
        if (params["x"] < 0.3).any():
            raise ValueError("too small")
        return {"loss": params["x"]}

    found = minimise(trial, {"x": (-1.0, 1.0)}, population=8)
    assert 0.3 <= found.params["x"] < 0.32 and found.errors == ("ValueError: too small",)
    assert np.isnan(found.tried_values[found.tried["x"] < 0.3]).all()
    assert sum(g.failed for g in found.history) == np.isnan(found.tried_values).sum() > 0


def test_all_fail():
    """An error that says why."""

    def trial(world, params):
        raise ValueError("never works")

    with pytest.raises(EstimationError, match="trials failed; the first one said: ValueError: never works"):
        minimise(trial, {"x": (0.0, 1.0)}, generations=2)


def test_over_an_executor():
    """Single worlds over threads find what a batch finds."""

    def single(world, params):
        return {"loss": (params["x"] - 0.25) ** 2}

    with ThreadPoolExecutor(2) as executor:
        found = minimise(each(single), {"x": (0.0, 1.0)}, executor=executor, generations=8)
    batch = minimise(single, {"x": (0.0, 1.0)}, generations=8)
    assert found.tried_values.tolist() == batch.tried_values.tolist()


@pytest.mark.parametrize(
    ("bounds", "options", "error", "message"),
    [
        ({}, {}, InvalidInputError, "low, high"),
        ({"x": (1.0, 0.0)}, {}, InvalidInputError, "low < high"),
        ({"x": (0.0, np.inf)}, {}, InvalidInputError, "must be finite"),
        ({"x": (0.0, 1.0)}, {"log_scale": ["x"]}, InvalidInputError, "positive for a log scale"),
        ({"x": (0.0, 1.0)}, {"log_scale": "x"}, InvalidInputError, "log_scale must be a sequence"),
        ({"x": (0.0, 1.0)}, {"start": {"y": 0.0}}, UnknownNameError, "no bound named 'y'"),
        ({"x": (0.0, 1.0)}, {"start": {"x": 2.0}}, InvalidInputError, "start of 'x'"),
        ({"x": (0.0, 1.0)}, {"population": 2}, InvalidInputError, "population"),
        ({"x": (0.0, 1.0)}, {"generations": 0}, InvalidInputError, "generations"),
        ({"x": (0.0, 1.0)}, {"step": 0.0}, InvalidInputError, "step"),
        ({"x": (0.0, 1.0)}, {"value": "cost"}, InvalidInputError, "but no 'cost'"),
    ],
)
def test_bad_arguments(bounds, options, error, message):
    """Each is named."""
    with pytest.raises(error, match=message):
        minimise(lambda world, params: {"loss": params["x"]}, bounds, **options)


def test_value_must_be_a_number():
    """Not an array a world."""
    with pytest.raises(InvalidInputError, match="one number a world"):
        minimise(lambda world, params: {"loss": np.zeros((len(params["x"]), 2))}, {"x": (0.0, 1.0)})
