"""Cloths that come to rest in the hand: which leave the batch, and that the others do not notice."""

import numpy as np
import pytest
from test_together import settings as settings

from nuno.estimate import futures
from nuno.estimate.coming_to_rest import REST_SPEED, ComingToRest, groups
from nuno.estimate.futures import imagine_picks, solver_of
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation
from nuno.estimate.together import imagine_together
from nuno.numbers.lanes import LANES

STILL, SLOW, FAST = 0.5 * REST_SPEED, 1.5 * REST_SPEED, 10.0 * REST_SPEED


def test_worlds_leave_where_the_others_are_fewer_groups():
    """Of 17 worlds, two groups, one has to leave; a world that swung through its turning point does not."""
    resting = ComingToRest(LANES + 1)
    speeds = np.full(LANES + 1, FAST)
    assert not resting.look(speeds) and resting.leave() is None
    speeds[3] = STILL  # it was fast a look before
    assert not resting.look(speeds) and resting.leave() is None
    assert not resting.look(speeds)
    stay = resting.leave()
    assert np.flatnonzero(~stay).tolist() == [3] and len(resting.going) == LANES
    assert not resting.look(np.where(np.arange(LANES) < 9, STILL, SLOW)) and resting.leave() is None
    assert groups(LANES) == 1 and groups(LANES + 1) == 2


def test_nine_of_ten_at_rest_are_enough():
    """Those that left count as at rest: the 90th percentile of all is asked, linear between them."""
    resting = ComingToRest(21)
    resting.look(np.full(21, SLOW))
    assert not resting.look(np.where(np.arange(21) < 18, STILL, FAST))
    resting.leave()
    assert resting.going.tolist() == [18, 19, 20]
    assert not resting.look(np.array((FAST, FAST, FAST)))
    assert resting.look(np.array((FAST, FAST, STILL)))


@pytest.fixture(scope="module")
def stage():
    """Two guesses, limp and stiff."""
    return Discretisation(6, 6, (HYPOTHESES[0], HYPOTHESES[9]))


def test_what_leaves_and_what_goes_on_are_as_in_one_batch(settings, stage, monkeypatch):
    """Of 24 worlds some leave; positions and velocities are those of one batch at each world's moment, to the bit."""
    uv = np.array([(u, v) for u in (0.0, 0.5, 1.0) for v in np.linspace(0.0, 1.0, 4)])
    counts = []
    begin = futures.begin_picks
    monkeypatch.setattr(futures, "begin_picks", lambda *a, **k: counts.append(k.get("numbers")) or begin(*a, **k))
    alone = imagine_picks(candidates=uv, discretisation=stage, **settings)
    assert counts[0] is None and len(counts) > 1 and len(counts[-1]) <= LANES
    part = imagine_together((stage,), np.arange(12), uv, **settings).part(stage, np.arange(12))
    assert len(set(part.at)) > 1
    np.testing.assert_array_equal(part.positions.numpy(), alone.positions.numpy())
    for number in (int(np.argmin(part.at)), int(np.argmax(part.at))):
        batch, place = part.whole(number)
        for a, b in zip(*(solver_of(f.body).velocities_apart() for f in (batch, alone)), strict=True):
            np.testing.assert_array_equal(a[place], b[number])
