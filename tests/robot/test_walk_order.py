"""Orders to walk that are kept for later."""

from nuno.robot.walk_order import WalkOrder, queued


def test_an_order_takes_the_place_of_all_that_waits_for_after_it():
    """As a robot that is told something else gives up what it was to do later; each is as much later as asked."""
    waiting = [WalkOrder(1.0, (0.1, 0.0, 0.0)), WalkOrder(3.0, None)]
    given = [WalkOrder(2.0, (0.2, 0.0, 0.0)), WalkOrder(2.0, None)]
    found = queued(waiting, given, 0.5)
    assert [own.clock for own in found] == [1.5, 2.5, 2.5]
    assert [own.place for own in found] == [(0.1, 0.0, 0.0), (0.2, 0.0, 0.0), None]
    assert queued(waiting, []) and [own.clock for own in queued(waiting, [])] == [1.0, 3.0]
