"""Compiling as a stage of its own, and what is said of it: from what Warp tells its logger."""

import logging
import threading
import time

import pytest
import warp as wp

from nuno.kernels.compile_watch import LOGGED_AFTER, Stages, compiling_watched


class Heard:
    """A logger of Warp that keeps what it gets."""

    def __init__(self):
        self.messages = []

    def debug(self, message):
        """Keep it."""
        self.messages.append(message)

    info = error = debug

    def warning(self, message, category=None, stacklevel=1):
        """Keep it."""
        self.messages.append(message)


@pytest.fixture
def heard():
    """Such a logger in the place of Warp's, at the level of the commands; both are put back."""
    before, level = wp.get_logger(), wp.config.log_level
    logger = Heard()
    wp.set_logger(logger)
    wp.config.log_level = wp.LOG_ERROR
    yield logger
    wp.set_logger(before)
    wp.config.log_level = level


def loaded(seconds, how="compiled"):
    """What Warp says of a module that it has loaded."""
    return f"Module nuno.state.pack 1d8a9a2 load on device 'cpu' took {1000.0 * seconds:.2f} ms  ({how})"


def test_warp_says_what_is_listened_for(heard):
    """A module that is loaded is a message of the form that is looked for, and takes time."""
    from nuno.state import pack

    module = wp.get_module(pack.__name__)
    module.unload()
    with compiling_watched():
        stages = Stages("compile", "imagine")
        wp.load_module(module, device="cpu")
        stages.end("imagine")
    assert 0.0 < stages.seconds["compile"]


def test_compiling_is_a_stage_wherever_it_happens(heard):
    """Its seconds are not another stage's, and all add up; those of other threads are theirs."""
    with compiling_watched():
        stages = Stages("compile", "imagine")
        thread = threading.Thread(target=lambda: wp.get_logger().info(loaded(5.0)))
        thread.start()
        thread.join()
        time.sleep(0.03)
        wp.get_logger().info(loaded(0.02))
        stages.end("imagine")
    seconds = stages.total()
    assert seconds["compile"] == pytest.approx(0.02)
    assert seconds["imagine"] >= 0.01
    assert seconds["total"] == seconds["compile"] + seconds["imagine"]


@pytest.mark.parametrize("how", ["compiled", "cached"])
def test_a_wait_is_told_by_name(heard, caplog, how):
    """Module and seconds; short ones are not worth it."""
    with caplog.at_level(logging.WARNING), compiling_watched():
        wp.get_logger().info(loaded(0.9 * LOGGED_AFTER, how))
        assert caplog.messages == []
        wp.get_logger().info(loaded(17.34, how))
    assert len(caplog.messages) == 1 and "17.3 s" in caplog.text and "nuno.state.pack" in caplog.text
    assert heard.messages == []  # the level asks for errors only


def test_where_warp_says_it_nothing_is_said_twice(heard, caplog):
    """At Warp's own level its message goes on, and there is no warning."""
    wp.config.log_level = wp.LOG_INFO
    with caplog.at_level(logging.WARNING), compiling_watched():
        wp.get_logger().info(loaded(17.34))
    assert heard.messages == [loaded(17.34)] and caplog.messages == []


def test_logger_and_level_are_put_back(heard):
    """Also after an error, and where two watch at once and the first ends first."""
    first, second = compiling_watched(), compiling_watched()
    first.__enter__()
    second.__enter__()
    assert wp.config.log_level == wp.LOG_INFO
    wp.get_logger().warning("no")
    wp.get_logger().error("yes")
    first.__exit__(None, None, None)
    assert wp.get_logger() is not heard
    second.__exit__(None, None, None)
    assert wp.get_logger() is heard and wp.config.log_level == wp.LOG_ERROR and heard.messages == ["yes"]
    with pytest.raises(ValueError), compiling_watched():
        raise ValueError
    assert wp.get_logger() is heard and wp.config.log_level == wp.LOG_ERROR
