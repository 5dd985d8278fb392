"""Stiff constraints in MuJoCo: the solver parameters of what is not to give way."""

STIFF = (0.9999, 0.9999, 0.001, 0.5, 2.0)
"""``solimp`` of equalities, stops and dry friction."""
CLOSING = 2.0
"""Their time constant, in substeps."""
