"""Yarns' stretch by all threads of a CUDA block: a thread an edge.

As in `nuno.solver.yarns` all rows are freed of their neighbours at once, step by step, but the rows lie in the block's
own memory. Yarns that follow one another are solved side by side: where one ends, its row is linked to none.
"""

from typing import Any

import warp as wp

from nuno.contact.renewal import shares_work
from nuno.solver.fine import fine
from nuno.solver.frame import stretch_yarns
from nuno.solver.lanes import barrier
from nuno.solver.membrane import stretch_yarn
from nuno.solver.state import Settings, Topology

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
const float s = 1.f / (wa + wb + soft.data[which.data[e]] * (scale.data[e] * rate) + 1.0e-12f);
float high = k + 1 < count ? rows[1][0][k + 1] * s : 0.f;
float pull = (own ? rest.data[e] - length : 0.f) * s;
low *= s;
int turn = 0;
for (int shift = 1; shift < longest; shift *= 2) {
    rows[turn][0][k] = low; rows[turn][1][k] = high; rows[turn][2][k] = pull;
    __syncthreads();
    const bool down = k >= shift, up = k + shift < 512;
    const int i = down ? k - shift : 0, j = up ? k + shift : 0;
    const float lb = down ? rows[turn][0][i] : 0.f, la = up ? rows[turn][0][j] : 0.f;
    const float hb = down ? rows[turn][1][i] : 0.f, ha = up ? rows[turn][1][j] : 0.f;
    const float pb = down ? rows[turn][2][i] : 0.f, pa = up ? rows[turn][2][j] : 0.f;
    const float t = 1.f / (1.f - low * hb - high * la);
    pull = (pull - low * pb - high * pa) * t;
    low = -low * lb * t;
    high = -high * ha * t;
    turn = 1 - turn;
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
    soft: wp.array(dtype=float),
    edge: wp.array(dtype=wp.vec2i),
    rest: wp.array(dtype=float),
    scale: wp.array(dtype=float),
    which: wp.array(dtype=int),
    first: int,
    last: int,
    longest: int,
    rate: float,
):
    """Solve the edges first to last, those of whole yarns of at most ``longest`` edges, and move their vertices.

    For the other arguments see `nuno.solver.yarns.stretch_yarns_together`. All threads of the block come here.
    """
    ...


@wp.func_native(_EDGES)
def stretch_edges(
    x: wp.array(dtype=fine),
    y: wp.array(dtype=fine),
    z: wp.array(dtype=fine),
    w: wp.array(dtype=float),
    soft: wp.array(dtype=float),
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
def stretch_yarns_of_block(
    t: Any, table: Topology, lengths: wp.array(dtype=float), run: Settings, first: int, last: int, thread: int,
    threads: int,
):  # fmt: skip
    """The yarns first to last: on CUDA by a block, as many at once as it has threads for; else each by a thread.

    ``lengths`` is ``rest`` as `nuno.solver.membrane.stretch_yarn` has it.
    """
    if shares_work(threads):
        rate = 1.0 / (run.dt * run.dt)
        k = int(first)
        while k < last:
            start = table.yarn[k]
            longest = int(0)
            while k < last and table.yarn[k + 1] - start <= threads:
                longest = wp.max(longest, table.yarn[k + 1] - table.yarn[k])
                k += 1
            if longest > 0:
                stretch_edges(
                    t.x, t.y, t.z, t.w, t.stretch_soft, table.edge, lengths, table.edge_scale, table.edge_soft, start,
                    table.yarn[k], longest, rate,
                )  # fmt: skip
            else:
                if thread == 0:
                    stretch_yarn(
                        t, table, lengths, t.yarn_gain, t.yarn_pull, t.yarn_inverse, start, table.yarn[k + 1], rate
                    )
                k += 1
            barrier(threads)
    else:
        stretch_yarns(t, table, lengths, run, run.sweeps, first, last, thread, threads)
