"""Strips of a sheet in registers, as a CUDA warp has them, beside the plain constraints, colour by colour."""

import numpy as np
import pytest
import warp as wp

import nuno
from nuno.constraints.bending import bend_alpha
from nuno.constraints.membrane import shear_alpha
from nuno.numbers.warps import WARP
from nuno.plans.cloth_elastic import bend_lines, bend_twists, shear_cells
from nuno.plans.sheet_strips import fits_strips, line_strips, shear_strips, twist_strips
from nuno.state.cloth_state import Settings, StateFloat, Topology
from played_lanes import SUBSTEP, keep_moved, launch, played_lane, put_back, wrinkled_sheet

TWISTS, LINES, SHEARS = range(3)
PASSES = 5
"""An exchange hangs on three others at most."""


@wp.kernel(enable_backward=False)
def _strips(
    s: StateFloat, table: Topology, start: wp.array(dtype=float), out: wp.array(dtype=float),
    exchanged: wp.array(dtype=float), kind: int, half: int, rate: float,
):  # fmt: skip
    n = table.particles
    twist = bend_alpha(s.bend_compliance[table.twist_compliance[0]], table.twist_scale[0], rate)
    shear = shear_alpha(s.shear_compliance[table.cell_compliance[0]], table.cell_scale[0], rate)
    passes = int(PASSES)
    lanes = int(WARP)
    for k in range(passes):
        for lane in range(lanes):
            put_back(s, n, start)
            exchanged[0] = 0.0
            own = played_lane(lane, exchanged)
            if kind == TWISTS:
                twist_strips(s, table, half, twist, rate, own)
            elif kind == LINES:
                line_strips(s, table, half, rate, own)
            else:
                shear_strips(s, table, half, shear, rate, own)
            if k == passes - 1:
                keep_moved(s, n, start, out)


@wp.kernel(enable_backward=False)
def _plain(
    s: StateFloat, table: Topology, start: wp.array(dtype=float), out: wp.array(dtype=float),
    exchanged: wp.array(dtype=float), kind: int, half: int, run: Settings,
):  # fmt: skip
    put_back(s, table.particles, start)
    if kind == LINES:
        for c in range(3 * half, 3 * half + 3):
            bend_lines(s, table, run, table.line_colour[c], table.line_colour[c + 1], 0, 1)
    else:
        for c in range(2 * half, 2 * half + 2):
            if kind == TWISTS:
                bend_twists(s, table, run, table.twist_colour[c], table.twist_colour[c + 1], 0, 1)
            else:
                shear_cells(s, table, s.cell_sum, run, 0, table.cell_colour[c], table.cell_colour[c + 1], 0, 1)
    keep_moved(s, table.particles, start, out)


@wp.kernel(enable_backward=False)
def _fits(table: Topology, out: wp.array(dtype=int)):
    if fits_strips(table):
        out[0] = 1


@pytest.mark.long
@pytest.mark.parametrize("differ", [False, True], ids=["uniform", "each its own"])
@pytest.mark.parametrize("cells", [(5, 4), (12, 7), (31, 5), (63, 5), (6, 47), (4, 191)])
def test_strips_do_what_the_plain_constraints_do(cells, differ):
    """Promise: the same source in another order of the same colours, so the same bits, of twists, bends and shears."""
    number = np.random.default_rng(7)

    def each(value):
        return number.uniform(0.2 * value, 5.0 * value, cells[0] * cells[1]) if differ else value

    material = nuno.Cloth(shear_stiffness=each(30.0), bending_rigidity=each(1e-4))
    state, table, start = wrinkled_sheet(cells, material)
    fits = wp.zeros(1, dtype=int, device="cpu")
    wp.launch(_fits, dim=1, inputs=[table, fits], device="cpu")
    assert fits.numpy()[0] == 1
    run = Settings()
    run.dt = SUBSTEP
    rate = np.float32(1.0) / (np.float32(SUBSTEP) * np.float32(SUBSTEP))
    for kind in (TWISTS, LINES, SHEARS):
        for half in (0, 1):
            expected = launch(_plain, state, table, start, kind, half, run)
            found = launch(_strips, state, table, start, kind, half, float(rate))
            np.testing.assert_array_equal(found, expected, err_msg=f"{('twists', 'lines', 'shears')[kind]}, {half}")
            start = expected
    assert np.abs(start - wrinkled_sheet(cells, material)[2]).max() > 1e-4
