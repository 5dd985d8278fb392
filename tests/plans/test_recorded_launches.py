"""Recorded launches do what launches do, whatever of their arguments is new."""

import numpy as np
import warp as wp

from nuno.plans.recorded_launches import RecordedLaunches


@wp.struct
class Line:
    """Numbers and a factor."""

    values: wp.array(dtype=float)
    factor: float


@wp.kernel(enable_backward=False)
def fill_line(line: Line, offset: float, out: wp.array(dtype=float)):
    """The line's numbers times its factor, and an offset."""
    i = wp.tid()
    out[i] = line.values[i] * line.factor + offset


def test_what_is_new_is_taken():
    """A field, a number, an array, a structure and the number of threads change from launch to launch, one by one."""
    launches, out = RecordedLaunches("cpu", 1), wp.zeros(4, dtype=float, device="cpu")

    def line(values, factor):
        made = Line()
        made.values, made.factor = wp.array(values, dtype=float, device="cpu"), factor
        return made

    def launched(what, offset, into, dim=4):
        launches.launch(fill_line, dim, [what, offset, into])
        return into.numpy().tolist()

    one = line([1.0, 2.0, 3.0, 4.0], 2.0)
    assert launched(one, 0.5, out) == [2.5, 4.5, 6.5, 8.5]
    one.factor = 3.0
    assert launched(one, 0.5, out) == [3.5, 6.5, 9.5, 12.5]
    one.values = wp.array([0.0, 1.0, 0.0, 1.0], dtype=float, device="cpu")
    assert launched(one, 0.5, out) == [0.5, 3.5, 0.5, 3.5]
    assert launched(one, 1.0, out) == [1.0, 4.0, 1.0, 4.0]
    other = wp.zeros(4, dtype=float, device="cpu")
    assert launched(one, 1.0, other, dim=2) == [1.0, 4.0, 0.0, 0.0]
    assert launched(line([5.0] * 4, 1.0), 1.0, other) == [6.0] * 4
    assert np.array_equal(out.numpy(), [1.0, 4.0, 1.0, 4.0])


@wp.kernel(enable_backward=False)
def number_worlds(out: wp.array(dtype=float), first: int):
    """Each world's number."""
    world = first + wp.tid() / 2
    wp.atomic_add(out, world, float(world))


def test_worlds_are_gone_through_once_each_in_parts():
    """Twice a number is what two threads of a world add up, however many parts the worlds are cut into."""
    launches = RecordedLaunches("cpu", 1)
    for worlds in (1, 3, 64, 65):
        for _ in range(2):  # the second time as recorded
            out = wp.zeros(worlds, dtype=float, device="cpu")
            launches.launch_worlds(number_worlds, worlds, 2, [out])
            np.testing.assert_array_equal(out.numpy(), 2.0 * np.arange(worlds))
