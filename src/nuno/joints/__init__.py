"""Grips, ties, welds and joints as handles, and the numbers that solvers need of them."""
