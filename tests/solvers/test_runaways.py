"""Bodies that are thrown are told once, by name."""

import logging

import nuno


def told(caplog):
    """What was told of bodies that are thrown."""
    return [record.getMessage() for record in caplog.records if "something throws it" in record.getMessage()]


def test_a_body_that_is_thrown_is_told_once(caplog):
    """One that is fast as no robot throws, by itself and in copies; not one that is a bullet's half as fast."""
    world = nuno.World(device="cpu")
    slow, fast = (world.add(nuno.box((0.1, 0.1, 0.1), name=name, position=(k, 0, 1))) for k, name in enumerate("ab"))
    world.attach(slow, nuno.Rigid(), velocity=(0.0, 150.0, 0.0))
    world.attach(fast, nuno.Rigid(), velocity=(0.0, 450.0, 0.0))
    with caplog.at_level(logging.WARNING):
        world.step()
        assert len(told(caplog)) == 1 and "'b' moves at 450 m/s" in told(caplog)[0]
        world.step()
        world.imagine(2).step()
        assert len(told(caplog)) == 1
