"""Solvers: the arrays of bodies on a device, and the plan that runs them."""
