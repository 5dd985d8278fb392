"""A program that uses Nuno prints nothing that it did not print itself, and errors are still seen.

tests/test_docs.py runs a program in a process of its own, and looks at all that this prints.
"""

import logging

import warp as wp

from nuno.kernels import quiet
from nuno.kernels.compile_watch import compiling_watched


def test_an_estimate_prints_nothing_either(monkeypatch):
    """What it watches compiling with stands on the quiet logger, not on Warp's own."""
    before = wp.get_logger()
    try:
        wp.set_logger(None)
        monkeypatch.setattr(wp.config, "log_level", wp.LOG_INFO)
        with compiling_watched():
            assert isinstance(wp.get_logger().logger, quiet._Quiet)
    finally:
        wp.set_logger(before)


def test_long_compiling_is_told_and_the_rest_is_not(monkeypatch, caplog):
    """One warning for a module that takes over two seconds; warnings and errors of Warp's go through."""

    class Own:
        def __init__(self):
            self.said = []

        def warning(self, message, category=None, stacklevel=1):
            self.said.append(message)

        def error(self, message):
            self.said.append(message)

    own = Own()
    told = quiet._Quiet(own)
    with caplog.at_level(logging.INFO):
        told.info("Module nuno.state.pack 1d8a9a2 load on device 'cpu' took 2500.00 ms  (compiled)")
        told.info("Module nuno.state.pack 1d8a9a2 load on device 'cpu' took 2500.00 ms  (cached)")
        told.info("Warp 1.19.0 initialized:")
    assert [record.getMessage().split(",")[0] for record in caplog.records] == [
        "waited 2.5 s for the kernels of nuno.state.pack"
    ]
    told.warning("careful")
    told.error("broken")
    assert own.said == ["careful", "broken"]


def test_what_a_program_chose_is_kept(monkeypatch):
    """Its log level and its logger."""
    before = wp.get_logger()
    try:
        mine = quiet._Quiet(None)
        wp.set_logger(mine)
        quiet.quiet_warp()
        assert wp.get_logger() is mine
        wp.set_logger(None)
        default = wp.get_logger()
        monkeypatch.setattr(wp.config, "log_level", wp.LOG_DEBUG)
        quiet.quiet_warp()
        assert wp.get_logger() is default
    finally:
        wp.set_logger(before)
