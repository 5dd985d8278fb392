"""A program that uses Nuno prints nothing that it did not print itself, and errors are still seen."""

import logging
import subprocess
import sys

import warp as wp

from nuno.kernels import quiet
from nuno.kernels.compile_watch import compiling_watched

PROGRAM = """
import nuno
world = nuno.World(device="cpu")
towel = world.add(nuno.sheet((0.2, 0.2), cells=(4, 4), position=(0, 0, 0.5)))
world.attach(towel)
world.run(0.1)
print("done")
"""


def test_a_program_prints_its_own_lines_only():
    """Warp's banner and the modules that it loads are not on standard output."""
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=500)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "done\n"


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
