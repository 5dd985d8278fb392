"""Sweeps: parameters, what is returned and recorded, failures, stopping, refusals."""

import csv
import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import searched

import nuno
import nuno.search as search
from nuno.errors import FileFormatError, InvalidInputError, ResultsMismatchError, UnknownNameError


def test_grid():
    """Every combination, the last name's value changing fastest; strings and vectors too."""
    grid = {"x": [1, 2], "name": ["a", "b", "c"], "at": [[0.0, 1.0]]}
    seen = []

    def trial(world, params):
        seen.append(params)
        return {"y": params["x"] * 1.5}

    found = search.sweep(trial, grid)
    assert found.params["x"].tolist() == [1, 1, 1, 2, 2, 2]
    assert found.params["name"].tolist() == ["a", "b", "c"] * 2
    assert found.params["at"].shape == (6, 2) and found.row(5) == {"x": 2, "name": "c", "at": [0.0, 1.0]}
    assert found.values("y").tolist() == [1.5, 1.5, 1.5, 3.0, 3.0, 3.0]
    assert seen[0]["x"].dtype == np.int64 and seen[0]["at"].shape == (6, 2)


def test_list():
    """A mapping for each trial; the first number decides nothing about the type of the column."""
    found = search.sweep(searched.square, [{"x": 2}, {"x": 0.5}], batch=False)
    assert found.values("y").tolist() == [4.0, 0.25]


def test_sampler():
    """Each trial draws from a generator of its own: the same seed gives the same, and more samples add to them."""
    sampler = search.Uniform({"x": (1.0, 2.0), "z": (1e-6, 1e-2)}, log=("z",))
    found = search.sweep(searched.square, sampler, samples=400, seed=3)
    fewer = search.sweep(searched.square, sampler, samples=4, seed=3)
    assert fewer.params["x"].tolist() == found.params["x"][:4].tolist()
    x, z = found.params["x"], found.params["z"]
    assert x.min() >= 1.0 and x.max() <= 2.0 and z.min() >= 1e-6 and z.max() <= 1e-2
    # the means of 400 even draws, within five of their standard deviations range / sqrt(12 * 400)
    assert abs(x.mean() - 1.5) < 5 / np.sqrt(4800) and abs(np.log10(z).mean() + 4.0) < 5 * 4 / np.sqrt(4800)


def test_results_file(tmp_path):
    """A header, then a line for each trial, in the order in which they finished; it can be read while it grows."""
    path = tmp_path / "results.jsonl"
    found = search.sweep(searched.square, {"x": [1, 2, 3]}, results=path)
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert lines[0] | {"parameters": ""} == {
        "format": "nuno sweep", "version": 1, "trial": "searched:square", "world": None, "trials": 3, "parameters": "",
    }  # fmt: skip
    assert lines[2] == {"trial": 1, "params": {"x": 2}, "values": {"y": 4.0}}
    read = search.read_sweep(path)
    assert read.params["x"].tolist() == [1, 2, 3] and read.values("y").tolist() == found.values("y").tolist()
    assert search.sweep(never, {"x": [1, 2, 3]}, results=renamed(path)).values("y").tolist() == [1, 4, 9]


def never(world, params):
    """A trial that must not run."""
    raise AssertionError("it ran again")


def renamed(path):
    """Let a results file be one of `never`."""
    text = path.read_text().replace("searched:square", f"{__name__}:never")
    path.write_text(text)
    return path


def returns_everything(world, params):
    """Numbers of all kinds, among them such that JSON has no word for."""
    x = params["x"].astype(float)
    return {
        "not_finite": np.stack([x * np.nan, x * np.inf, -x * np.inf, x / 3.0], axis=1),
        "single": (x / 3.0).astype(np.float32), "whole": params["x"].astype(np.int32), "sure": params["x"] > 1,
        "why": np.array(["NaN", "it fell", "inf"])[params["x"] % 3],
        "large": np.random.default_rng(0).normal(size=(len(x), 40, 30)) * x[:, None, None],
        "none": np.zeros((len(x), 0, 3)),
    }  # fmt: skip


def test_values_survive_the_file(tmp_path):
    """What comes out of the file is what the trial returned, to the bit, with its type and shape."""
    path = tmp_path / "results.jsonl"
    first = search.sweep(returns_everything, {"x": [1, 2, 3]}, results=path)
    again = search.sweep(returns_everything, {"x": [1, 2, 3]}, results=path)
    for name in first.names:
        a, b = first.values(name), again.values(name)
        assert a.shape == b.shape and a.dtype.kind == b.dtype.kind
        np.testing.assert_array_equal(a, b)
    assert first.values("single").tolist() == [float(np.float32(x / 3.0)) for x in (1.0, 2.0, 3.0)]
    assert sorted(p.name for p in (tmp_path / "results.jsonl.arrays").iterdir()) == [
        "000000.npz", "000001.npz", "000002.npz"
    ]  # fmt: skip
    for line in path.read_text().splitlines():
        json.loads(line, parse_constant=pytest.fail)  # strict JSON: no NaN, no Infinity


def test_failing_trials(tmp_path, caplog):
    """One that raises is recorded with its error, and the rest of its batch goes on."""
    path = tmp_path / "results.jsonl"
    found = search.sweep(searched.failing_square, {"x": [1, 2, 3, 4, 3]}, results=path)
    assert found.failures == {2: "ValueError: three is not allowed", 4: "ValueError: three is not allowed"}
    np.testing.assert_array_equal(found.values("y"), [1, 4, np.nan, 16, np.nan])
    assert found.is_complete and found.best("y") == 0 and found.best("y", highest=True) == 3
    again = search.sweep(searched.failing_square, {"x": [1, 2, 3, 4, 3]}, results=path)
    assert again.failures == found.failures, "a failure is a result: it is not run again"
    found.save_csv(tmp_path / "table.csv")
    rows = list(csv.reader(open(tmp_path / "table.csv")))
    assert rows[0] == ["trial", "x", "y", "error"] and rows[1] == ["0", "1", "1", ""]
    assert rows[3] == ["2", "3", "", "ValueError: three is not allowed"]


def test_diverging_worlds():
    """A world that diverges is named, and the others give the same bits as without it."""
    calm = [0.1, 0.2, 0.3]
    found = search.sweep(searched.pushed_towel, {"force": [0.1, 1e30, 0.2, 1e25, 0.3]}, world=searched.table_with_towel)
    assert sorted(found.failures) == [1, 3] and "SimulationDiverged" in found.failures[1]
    alone = search.sweep(searched.pushed_towel, {"force": calm}, world=searched.table_with_towel)
    assert found.values("height")[[0, 2, 4]].tolist() == alone.values("height").tolist()


def test_diverged_names_its_worlds():
    """The error of a batch says which worlds it comes from."""
    futures = searched.table_with_towel().imagine(3)
    with pytest.raises(nuno.SimulationDiverged) as caught:
        searched.pushed_towel(futures, {"force": np.array([0.1, 1e30, 0.2])})
    assert caught.value.worlds == (1,)


@pytest.mark.long
def test_memory_runs_out():
    """A batch that is too large is divided, down to what fits."""
    sizes = []

    def hungry(world, params):
        if len(params["x"]) > 4:
            raise RuntimeError("Failed to allocate 1000000000 bytes on device 'cuda:0'")
        sizes.append(len(params["x"]))
        return {"y": params["x"]}

    assert not search.sweep(hungry, {"x": range(16)}).failures
    assert max(sizes) == 4


def test_stop_early(tmp_path):
    """No batch is begun after the one that is good enough, neither now nor when the file is taken up again."""
    path = tmp_path / "results.jsonl"

    def good(trial):
        return trial.values["y"] >= 9

    found = search.sweep(searched.square, {"x": range(10)}, batch=2, stop=good, results=path)
    assert found.stopped and not found.is_complete
    assert [trial is not None for trial in found.trials] == [True] * 4 + [False] * 6
    assert np.isnan(found.values("y")[4:]).all()
    again = search.sweep(searched.square, {"x": range(10)}, batch=2, stop=good, results=path)
    assert again.stopped and [t is not None for t in again.trials] == [t is not None for t in found.trials]
    whole = search.sweep(searched.square, {"x": range(10)}, results=path)
    assert whole.is_complete and not whole.stopped


def test_body_objects_of_a_given_world():
    """A world that is given as such stays as it is, and its bodies can be used in its copies."""
    world = searched.table_with_towel()
    towel = world.find("towel")

    def trial(futures, params):
        futures.attach(towel, nuno.Cloth(area_density=params["density"]))
        futures.run(0.05)
        return {"height": futures.find("towel").vertices[..., 2].mean(axis=1)}

    found = search.sweep(trial, {"density": [0.1, 0.2]}, world=world)
    assert found.values("height").shape == (2,) and not towel.is_dynamic and world.time == 0.0


@pytest.mark.parametrize(
    ("change", "what"),
    [({"x": [1, 2, 4]}, "parameters"), ({"x": [1, 2]}, "trials"), ({"z": [1, 2, 3]}, "parameters")],
)
def test_file_of_other_parameters(tmp_path, change, what):
    """It is refused, and stays as it is."""
    path = tmp_path / "results.jsonl"
    search.sweep(searched.square, {"x": [1, 2, 3]}, results=path)
    before = path.read_bytes()
    with pytest.raises(ResultsMismatchError, match=f"its {what} is"):
        search.sweep(searched.square, change, results=path)
    assert path.read_bytes() == before


def test_file_of_another_trial(tmp_path):
    """It is refused."""
    path = tmp_path / "results.jsonl"
    search.sweep(searched.square, {"x": [1, 2, 3]}, results=path)
    with pytest.raises(ResultsMismatchError, match=r"its trial is 'searched:square', this one's 'searched:failing"):
        search.sweep(searched.failing_square, {"x": [1, 2, 3]}, results=path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"shopping list", "is no results file"),
        (b"shopping\nlist\n", "is no results file"),
        (b'{"format": "nuno sweep", "version": 99}\n', "is of version 99"),
    ],
)
def test_file_of_something_else(tmp_path, content, message):
    """It is refused, and stays as it is."""
    path = tmp_path / "results.jsonl"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=message):
        search.sweep(searched.square, {"x": [1]}, results=path)
    assert path.read_bytes() == content


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda lines: [lines[0], b"{broken", *lines[2:]], "line 2 of .* is no trial's result"),
        (lambda lines: [*lines, lines[1]], "trial 0 stands in .* twice, again in line 5"),
        (lambda lines: [*lines, b'{"trial": 7, "params": {"x": 1}, "values": {}}'], "holds trial 7; there are 3"),
        (lambda lines: [*lines, b'{"trial": 2, "params": {}, "arrays": "7.npz"}'], "line 5"),
    ],
)
def test_damaged_file(tmp_path, spoil, message):
    """Damage before the last line is not passed over."""
    path = tmp_path / "results.jsonl"
    search.sweep(searched.square, {"x": [1, 2, 3]}, results=path)
    path.write_bytes(b"\n".join(spoil(path.read_bytes().splitlines())) + b"\n")
    with pytest.raises(FileFormatError, match=message):
        search.sweep(searched.square, {"x": [1, 2, 3]}, results=path)


@pytest.mark.parametrize(
    ("params", "options", "message"),
    [
        ({}, {}, "need names"),
        ([], {}, "no parameters"),
        ({"x": []}, {}, "no parameters"),
        ({"x": 3}, {}, "must be a sequence"),
        ({"x": "abc"}, {}, "must be a sequence"),
        ({"x": [1, "a"]}, {}, "must be numbers, bools or strings"),
        ({"x": [None]}, {}, "must be numbers, bools or strings"),
        ({"x": [1.0, np.nan]}, {}, "must be finite"),
        ({"x": [[1], [1, 2]]}, {}, "one shape"),
        ([{"x": 1}, {"y": 1}], {}, "trial 1 has parameters"),
        ([{"x": 1}, 2], {}, "trial 1 must be a mapping"),
        (7, {}, "a grid"),
        (search.Uniform({"x": (0.0, 1.0)}), {}, "needs samples="),
        ({"x": [1]}, {"samples": 3}, "goes with a sampler"),
        ({"x": [1]}, {"batch": 0}, "batch must be"),
        ({"x": [1]}, {"repeats": -1}, "repeats must be"),
        ({"x": [1]}, {"world": 3}, "world must be"),
        ({"x": [1]}, {"world": searched.broken_room}, "no room"),
        ({"x": [1]}, {"device": "tpu"}, "device must be"),
        ({"x": [1]}, {"executor": 4}, "must be a concurrent.futures.Executor"),
        ({"x": [1]}, {"results": "no/such/folder/results.jsonl"}, "there is no folder"),
    ],
)
def test_bad_arguments(params, options, message):
    """Each is named before anything runs."""
    with pytest.raises(InvalidInputError, match=message):
        search.sweep(searched.square, params, **options)


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (3, "must return a dict"),
        ({"y": 1.0}, "one row for each of 2 worlds"),
        ({"y": np.zeros(3)}, "one row for each of 2 worlds; 'y' has shape"),
        ({"y": [object(), object()]}, "numbers, bools or strings"),
        ({1: np.zeros(2)}, "names that are strings"),
    ],
)
def test_bad_returns(returned, message):
    """A trial that returns something else is a mistake in the program, not a failed trial."""
    with pytest.raises(InvalidInputError, match=message):
        search.sweep(lambda world, params: returned, {"x": [1, 2]})


def test_each_needs_an_executor():
    """A trial of single worlds runs over executors only."""
    with pytest.raises(InvalidInputError, match="pass executor="):
        search.sweep(search.each(searched.single_square), {"x": [1]})
    with pytest.raises(InvalidInputError, match="each needs a function"):
        search.each(3)
    with ThreadPoolExecutor(1) as executor:
        found = search.sweep(search.each(searched.single_square), {"x": [1, 2]}, executor=executor)
    assert found.values("y").tolist() == [1, 4]


def test_trials_must_be_importable():
    """A lambda cannot go to another process; the message says so before anything is sent."""
    from concurrent.futures import ProcessPoolExecutor

    with ProcessPoolExecutor(1) as executor:
        with pytest.raises(InvalidInputError, match="cannot be imported by another process"):
            search.sweep(lambda world, params: {}, {"x": [1]}, executor=executor)
        with pytest.raises(InvalidInputError, match=r"the world's function .* cannot be imported"):
            search.sweep(searched.square, {"x": [1]}, executor=executor, world=lambda: None)


def test_asking_for_what_is_not_there():
    """Unknown values are named, with those that there are."""
    found = search.sweep(returns_everything, {"x": [1, 2]})
    with pytest.raises(UnknownNameError, match="no value named 'height'; there are: large, none"):
        found.values("height")
    with pytest.raises(InvalidInputError, match="none is best"):
        found.best("large")


def test_bad_samplers():
    """Bounds that no number lies between."""
    with pytest.raises(InvalidInputError, match="low < high"):
        search.Uniform({"x": (1.0, 1.0)})
    with pytest.raises(InvalidInputError, match="positive for a log scale"):
        search.Uniform({"x": (0.0, 1.0)}, log=("x",))
    with pytest.raises(UnknownNameError, match="no bound named 'y'"):
        search.Uniform({"x": (0.0, 1.0)}, log=("y",))
    with pytest.raises(InvalidInputError, match=r"\(low, high\) by name"):
        search.Uniform({})
