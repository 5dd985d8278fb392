"""What errors say: what was received, what is valid, and what may have been meant."""

import pickle

import pytest

import nuno
from nuno.validation import finite_array, number


def test_a_name_that_is_nearly_right():
    """The nearest name is offered beside the list of all."""
    world = nuno.World(device="cpu")
    world.add(nuno.box((1, 1, 1), name="table"))
    world.add(nuno.sphere(0.1, name="ball"))
    with pytest.raises(nuno.UnknownNameError, match=r"no body named 'tabel'; there are: ball, table \(did you mean"):
        world.find("tabel")
    with pytest.raises(nuno.UnknownNameError, match=r"there are: ball, table$"):
        world.find("chair")


def test_errors_survive_another_process():
    """A worker's error arrives with its message and data."""
    error = nuno.UnknownNameError("body", "tabel", ["table"])
    assert "no body named 'tabel'; there are: table" in str(error)
    assert isinstance(pickle.loads(pickle.dumps(nuno.InvalidInputError("no"))), nuno.InvalidInputError)


@pytest.mark.parametrize("value", ["1.0", b"1", True, None, [1.0, 2.0], float("nan"), 10**400])
def test_no_number(value):
    """Text, truth and the like are no numbers, even where Python would make one of them."""
    with pytest.raises(nuno.InvalidInputError, match="size must be"):
        number("size", value)


@pytest.mark.parametrize("value", ["123", ["1", "2", "3"], [1.0, 2.0, "3"], [[1], [2, 3]], [1.0, 2.0, None], {}])
def test_no_array_of_numbers(value):
    """Text in it, ragged or empty."""
    with pytest.raises(nuno.InvalidInputError, match="place must"):
        finite_array("place", value, (3,))


def test_long_input_is_cut_short():
    """A message quotes the beginning of what was received."""
    with pytest.raises(nuno.InvalidInputError) as raised:
        finite_array("place", ["x" * 10_000], (3,))
    assert len(str(raised.value)) < 400
