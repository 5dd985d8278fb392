"""grid lines' stretch by all threads of a CUDA block: a thread an edge.

As in `nuno.plans.grid_lines_by_threads` all rows are freed of their neighbours at once, step by step, but the rows lie
in the block's own memory. grid lines that follow one another are solved side by side: where one ends, its row is linked
to none.
"""

from typing import Any

import warp as wp

from nuno.constraints.membrane import stretch_grid_line
from nuno.numbers.doubles import float64
from nuno.numbers.lanes import barrier, shares_work
from nuno.plans.cloth_substep import stretch_grid_lines
from nuno.state.cloth_state import Settings, Topology

_EDGES = """
#if defined(__CUDA_ARCH__)
__shared__ float rows[2][3][512];
const int k = threadIdx.x, count = last - first;
const bool own = k < count;
const int e = own ? first + k : first;
const int a = edge.data[e][0], b = edge.data[e][1];
// an edge goes on from where the one before ended
const bool linked = own && k > 0 && edge.data[e - 1][1] == a;
const decltype(x.data[0] + 0.f) px = x.data[b], py = y.data[b], pz = z.data[b];  // as coordinates are
const float wa = w.data[a], wb = w.data[b];
float ex = x.data[a] - px, ey = y.data[a] - py, ez = z.data[a] - pz;
const float length = sqrtf(ex * ex + ey * ey + ez * ez + 1.0e-20f);
const float inverse = 1.f / length;
ex *= inverse; ey *= inverse; ez *= inverse;
rows[0][0][k] = ex; rows[0][1][k] = ey; rows[0][2][k] = ez;
__syncthreads();
float low = linked ? -wa * (rows[0][0][k - 1] * ex + rows[0][1][k - 1] * ey + rows[0][2][k - 1] * ez) : 0.f;
rows[1][0][k] = low;
__syncthreads();
const float s = 1.f / (wa + wb + compliance.data[which.data[e]] * (scale.data[e] * rate) + 1.0e-12f);
float high = k + 1 < count ? rows[1][0][k + 1] * s : 0.f;
float pull = (own ? rest.data[e] - length : 0.f) * s;
low *= s;
int buffer = 0;
for (int shift = 1; shift < longest; shift *= 2) {
    rows[buffer][0][k] = low; rows[buffer][1][k] = high; rows[buffer][2][k] = pull;
    __syncthreads();
    const bool down = k >= shift, up = k + shift < 512;
    const int i = down ? k - shift : 0, j = up ? k + shift : 0;
    const float lb = down ? rows[buffer][0][i] : 0.f, la = up ? rows[buffer][0][j] : 0.f;
    const float hb = down ? rows[buffer][1][i] : 0.f, ha = up ? rows[buffer][1][j] : 0.f;
    const float pb = down ? rows[buffer][2][i] : 0.f, pa = up ? rows[buffer][2][j] : 0.f;
    const float t = 1.f / (1.f - low * hb - high * la);
    pull = (pull - low * pb - high * pa) * t;
    low = -low * lb * t;
    high = -high * ha * t;
    buffer = 1 - buffer;
}
ex *= pull; ey *= pull; ez *= pull;
__syncthreads();
rows[0][0][k] = ex; rows[0][1][k] = ey; rows[0][2][k] = ez;
__syncthreads();
if (own) {
    const bool on = k + 1 < count && edge.data[e + 1][0] == b;
    x.data[b] = px + wb * ((on ? rows[0][0][k + 1] : 0.f) - ex);
    y.data[b] = py + wb * ((on ? rows[0][1][k + 1] : 0.f) - ey);
    z.data[b] = pz + wb * ((on ? rows[0][2][k + 1] : 0.f) - ez);
    if (!linked) {
        x.data[a] += wa * ex;
        y.data[a] += wa * ey;
        z.data[a] += wa * ez;
    }
}
__syncthreads();
#endif
"""


@wp.func_native(_EDGES)
def stretch_edges(
    x: wp.array(dtype=float),
    y: wp.array(dtype=float),
    z: wp.array(dtype=float),
    w: wp.array(dtype=float),
    compliance: wp.array(dtype=float),
    edge: wp.array(dtype=wp.vec2i),
    rest: wp.array(dtype=float),
    scale: wp.array(dtype=float),
    which: wp.array(dtype=int),
    first: int,
    last: int,
    longest: int,
    rate: float,
):
    """Solve the edges first to last, those of whole grid lines of at most ``longest`` edges, and move their vertices.

    For the other arguments see `nuno.plans.grid_lines_by_threads.stretch_grid_lines_by_threads`. All threads of the
    block come here.
    """
    ...


@wp.func_native(_EDGES)
def stretch_edges(
    x: wp.array(dtype=float64),
    y: wp.array(dtype=float64),
    z: wp.array(dtype=float64),
    w: wp.array(dtype=float),
    compliance: wp.array(dtype=float),
    edge: wp.array(dtype=wp.vec2i),
    rest: wp.array(dtype=float),
    scale: wp.array(dtype=float),
    which: wp.array(dtype=int),
    first: int,
    last: int,
    longest: int,
    rate: float,
): ...


@wp.func
def stretch_grid_lines_of_block(
    t: Any, table: Topology, lengths: wp.array(dtype=float), run: Settings, first: int, last: int, rank: int,
    size: int,
):  # fmt: skip
    """The grid lines first to last: on CUDA by a block, as many at once as it has threads for; else each by a thread.

    ``lengths`` is ``rest`` as `nuno.constraints.membrane.stretch_grid_line` has it.
    """
    if shares_work(size):
        rate = 1.0 / (run.dt * run.dt)
        k = int(first)
        while k < last:
            start = table.grid_line[k]
            longest = int(0)
            while k < last and table.grid_line[k + 1] - start <= size:
                longest = wp.max(longest, table.grid_line[k + 1] - table.grid_line[k])
                k += 1
            if longest > 0:
                stretch_edges(
                    t.x, t.y, t.z, t.w, t.stretch_compliance, table.edge, lengths, table.edge_scale,
                    table.edge_compliance, start,
                    table.grid_line[k], longest, rate,
                )  # fmt: skip
            else:
                if rank == 0:
                    stretch_grid_line(
                        t,
                        table,
                        lengths,
                        t.grid_line_gain,
                        t.grid_line_pull,
                        t.grid_line_inverse,
                        start,
                        table.grid_line[k + 1],
                        rate,
                    )
                k += 1
            barrier(size)
    else:
        stretch_grid_lines(t, table, lengths, run, run.sweeps, first, last, rank, size)
