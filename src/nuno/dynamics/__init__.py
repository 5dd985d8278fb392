"""Dynamics: what a body has while it is attached, for particles and for rigid bodies."""
