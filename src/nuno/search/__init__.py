"""Searches over candidate motions and materials: sweeps in a batch, over processes and clusters, and minimisation."""

from nuno.search.device_share import own_device
from nuno.search.minimise import Minimum, minimise
from nuno.search.sampler import Uniform
from nuno.search.sweep import SweepResult, read_sweep, sweep
from nuno.search.trial import Trial, each

__all__ = ["Minimum", "SweepResult", "Trial", "Uniform", "each", "minimise", "own_device", "read_sweep", "sweep"]
