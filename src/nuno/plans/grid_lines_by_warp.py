"""A grid line's stretch by the 32 threads of a warp on CUDA, where coordinates are doubles.

`nuno.plans.grid_lines_by_threads` reads coordinates again to save registers, in ways that are for floats. Here all rows
are freed of their neighbours at once by cyclic reduction (Hockney and Jesshope, "Parallel Computers", 1981), a row a
thread and
step: each is linked to those twice as far as before.
"""

import warp as wp

from nuno.numbers.doubles import float64

PAIR_EDGES = wp.constant(32)
"""Edges of the longest grid lines of which a warp takes two side by side: each waits less for the other than for
itself."""
WARP_EDGES = wp.constant(256)
"""Edges of the longest grid line that a warp takes together: eight rows a thread."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
const unsigned all = 0xffffffffu;
const int lane = threadIdx.x % 32;
const int count = last - first, more = stop - start;
struct One { enum { rows = 1, apart = 0 }; };
struct Pair { enum { rows = 2, apart = 1 }; };
struct Two { enum { rows = 2, apart = 0 }; };
struct Eight { enum { rows = 8, apart = 0 }; };
auto solve = [&](auto kind) {
    // row k of the system is in thread k % 32; of two yarns apart each thread has a row of either
    constexpr int ROWS = decltype(kind)::rows;
    constexpr bool APART = decltype(kind)::apart;
    constexpr int REACH = APART ? 32 : 32 * ROWS;
    auto place = [&](int j) { return APART ? lane : 32 * j + lane; };
    auto length_of = [&](int j) { return APART && j > 0 ? more : count; };
    int end[ROWS];
    float ex[ROWS], ey[ROWS], ez[ROWS], inverse[ROWS], low[ROWS], high[ROWS], pull[ROWS];
    // what row k - shift, or k + shift, has
    auto before = [&](const float* v, int shift, float* r) {
        if (shift < 32) {
            float s[ROWS];
            for (int j = 0; j < ROWS; ++j) s[j] = __shfl_sync(all, v[j], (lane - shift) & 31);
            for (int j = ROWS - 1; j >= 0; --j)
                r[j] = lane >= shift ? s[j] : (j > 0 && !APART ? s[j > 0 ? j - 1 : 0] : 0.f);
        } else {
            #pragma unroll
            for (int j = 0; j < ROWS; ++j) {
                r[j] = 0.f;
                #pragma unroll
                for (int i = 0; i < ROWS; ++i) if (32 * (j - i) == shift) r[j] = v[i];
            }
        }
    };
    auto after = [&](const float* v, int shift, float* r) {
        if (shift < 32) {
            float s[ROWS];
            for (int j = 0; j < ROWS; ++j) s[j] = __shfl_sync(all, v[j], (lane + shift) & 31);
            for (int j = 0; j < ROWS; ++j)
                r[j] = lane + shift < 32 ? s[j] : (j < ROWS - 1 && !APART ? s[j < ROWS - 1 ? j + 1 : j] : 0.f);
        } else {
            #pragma unroll
            for (int j = 0; j < ROWS; ++j) {
                r[j] = 0.f;
                #pragma unroll
                for (int i = 0; i < ROWS; ++i) if (32 * (i - j) == shift) r[j] = v[i];
            }
        }
    };
    float wa[ROWS], wb[ROWS];
    double px[ROWS], py[ROWS], pz[ROWS];
    #pragma unroll
    for (int j = 0; j < ROWS; ++j) {
        const bool own = place(j) < length_of(j);
        const int e = own ? (APART && j > 0 ? start : first) + place(j) : first;
        const int a = edge.data[e][0], b = edge.data[e][1];
        px[j] = x.data[b]; py[j] = y.data[b]; pz[j] = z.data[b];
        wa[j] = w.data[a]; wb[j] = w.data[b];
        end[j] = own ? b : -1;
        const float dx = x.data[a] - px[j], dy = y.data[a] - py[j], dz = z.data[a] - pz[j];
        const float length = sqrtf(dx * dx + dy * dy + dz * dz + 1.0e-20f);
        inverse[j] = 1.f / length;
        ex[j] = dx * inverse[j]; ey[j] = dy * inverse[j]; ez[j] = dz * inverse[j];
        pull[j] = own ? rest.data[e] - length : 0.f;
        inverse[j] = wa[j] + wb[j] + compliance.data[which.data[e]] * (scale.data[e] * rate) + 1.0e-12f;
    }
    {
        float bx[ROWS], by[ROWS], bz[ROWS], coupling[ROWS];
        before(ex, 1, bx); before(ey, 1, by); before(ez, 1, bz);
        #pragma unroll
        for (int j = 0; j < ROWS; ++j) {
            const int k = place(j);
            coupling[j] = k > 0 && k < length_of(j) ? -wa[j] * (bx[j] * ex[j] + by[j] * ey[j] + bz[j] * ez[j]) : 0.f;
        }
        after(coupling, 1, high);
        #pragma unroll
        for (int j = 0; j < ROWS; ++j) {
            const float s = 1.f / inverse[j];
            low[j] = coupling[j] * s; high[j] *= s; pull[j] *= s;
        }
    }
    // unrolled, so that what a shift asks for is known; steps that are too many find nothing to link
    #pragma unroll
    for (int shift = 1; shift < REACH; shift *= 2) {
        float lb[ROWS], hb[ROWS], pb[ROWS], la[ROWS], ha[ROWS], pa[ROWS];
        before(low, shift, lb); before(high, shift, hb); before(pull, shift, pb);
        after(low, shift, la); after(high, shift, ha); after(pull, shift, pa);
        #pragma unroll
        for (int j = 0; j < ROWS; ++j) {
            const float s = 1.f / (1.f - low[j] * hb[j] - high[j] * la[j]);
            pull[j] = (pull[j] - low[j] * pb[j] - high[j] * pa[j]) * s;
            low[j] = -low[j] * lb[j] * s;
            high[j] = -high[j] * ha[j] * s;
        }
    }
    float nx[ROWS], ny[ROWS], nz[ROWS];
    #pragma unroll
    for (int j = 0; j < ROWS; ++j) { ex[j] *= pull[j]; ey[j] *= pull[j]; ez[j] *= pull[j]; }
    after(ex, 1, nx); after(ey, 1, ny); after(ez, 1, nz);
    #pragma unroll
    for (int j = 0; j < ROWS; ++j) {
        // all have read their ends in the first shuffles, so that nothing is overwritten too soon
        const int k = place(j);
        if (end[j] >= 0) {
            const bool on = k + 1 < length_of(j);
            x.data[end[j]] = px[j] + wb[j] * ((on ? nx[j] : 0.f) - ex[j]);
            y.data[end[j]] = py[j] + wb[j] * ((on ? ny[j] : 0.f) - ey[j]);
            z.data[end[j]] = pz[j] + wb[j] * ((on ? nz[j] : 0.f) - ez[j]);
        }
        if (k == 0 && length_of(j) > 0) {
            const int head = edge.data[APART && j > 0 ? start : first][0];
            x.data[head] += wa[j] * ex[j];
            y.data[head] += wa[j] * ey[j];
            z.data[head] += wa[j] * ez[j];
        }
    }
};
if (more > 0) solve(Pair());
else if (count <= 32) solve(One());
else if (count <= 64) solve(Two());
else solve(Eight());
#endif
""")
def stretch_double_grid_lines(
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
    start: int,
    stop: int,
    rate: float,
):
    """Solve the edges first to last of a grid line at once and move its vertices, or of two short ones side by side.

    Args:
        x: Coordinates; so are ``y`` and ``z`` [m].
        y: See ``x``.
        z: See ``x``.
        w: Inverse masses [1/kg].
        compliance: The world's compliances.
        edge: Vertices of the edges.
        rest: Their lengths [m].
        scale: What the compliance of each is multiplied with.
        which: The place of each in ``compliance``.
        first: The grid line's first edge.
        last: One past its last.
        start: The same of another grid line of at most 32 edges, which shares no vertex with the first, as short a one.
        stop: See ``start``, and the same where there is no other.
        rate: 1 / dt^2 [1/s2].
    """
    ...
