"""A grid line's stretch by a few neighbouring threads on CUDA, each with eight edges in its registers.

What `nuno.constraints.membrane.stretch_grid_line` does from one end to the other takes a step an edge, each waiting for
the one before. Here each thread eliminates its own rows but the last, as that does, with the last row of the thread
before as one more unknown (the partition method of Wang, "A parallel method for tridiagonal equations", 1981). What is
left, a row a thread, is solved by cyclic reduction (Hockney and Jesshope, "Parallel Computers", 1981): in each step a
row is freed of its neighbours and linked to those twice as far.
"""

import warp as wp

GRID_LINE_EDGES = wp.constant(256)
"""Edges of the longest grid line that threads of one warp solve: eight each."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
const unsigned all = 0xffffffffu;
const int lane = threadIdx.x % 32, warp = threadIdx.x / 32, warps = size / 32;
constexpr int ROWS = 8;
// read anew, once they are needed again: there are not registers enough to keep them
auto again = [](const float& a) { return *const_cast<const volatile float*>(&a); };
int power = 0;
while ((ROWS << power) < count) ++power;
const int span = 1 << power, each = 32 >> power, side = lane >> power, q = lane - (side << power);
for (int begin = warp * each; begin < grid_lines; begin += warps * each) {
    const int own = begin + side;
    const int start = first + (own < grid_lines ? own : begin) * count;
    const int here = own < grid_lines ? count : 0;
    const int head = edge.data[start][0], step = edge.data[start][1] - head;
    float length = rest.data[start];
    float alpha = compliance.data[which.data[start]] * (scale.data[start] * rate);
    // the thread's rows, and the vertices at both ends of each
    float vx[ROWS + 1], vy[ROWS + 1], vz[ROWS + 1], vw[ROWS + 1];
    #pragma unroll
    for (int r = 0; r <= ROWS; ++r) {
        const int k = q * ROWS + r;
        const int i = head + (k < count ? k : count) * step;
        vx[r] = x.data[i]; vy[r] = y.data[i]; vz[r] = z.data[i]; vw[r] = w.data[i];
    }
    float ex[ROWS], ey[ROWS], ez[ROWS], weight[ROWS], pull[ROWS];
    #pragma unroll
    for (int r = 0; r < ROWS; ++r) {
        const bool on = q * ROWS + r < here;
        if (__builtin_expect(varied, false) && on) {
            const int k = start + q * ROWS + r;
            alpha = compliance.data[which.data[k]] * (scale.data[k] * rate);
            length = rest.data[k];
        }
        const float dx = vx[r] - vx[r + 1], dy = vy[r] - vy[r + 1], dz = vz[r] - vz[r + 1];
        const float square = dx * dx + dy * dy + dz * dz + 1.0e-20f;
        const float inverse = rsqrtf(square);
        ex[r] = dx * inverse; ey[r] = dy * inverse; ez[r] = dz * inverse;
        pull[r] = on ? length - square * inverse : 0.f;
        weight[r] = on ? vw[r] + vw[r + 1] + alpha + 1.0e-12f : 1.f;
    }
    // what links each row to the one before, and the last one to the next thread's first
    float coupling[ROWS + 1];
    const float bx = __shfl_up_sync(all, ex[ROWS - 1], 1, span);
    const float by = __shfl_up_sync(all, ey[ROWS - 1], 1, span);
    const float bz = __shfl_up_sync(all, ez[ROWS - 1], 1, span);
    coupling[0] = q > 0 && q * ROWS < here ? vw[0] * (bx * ex[0] + by * ey[0] + bz * ez[0]) : 0.f;
    #pragma unroll
    for (int r = 1; r < ROWS; ++r) {
        const float c = vw[r] * (ex[r - 1] * ex[r] + ey[r - 1] * ey[r] + ez[r - 1] * ez[r]);
        coupling[r] = q * ROWS + r < here ? c : 0.f;
    }
    coupling[ROWS] = __shfl_down_sync(all, coupling[0], 1, span);
    if (q == span - 1) coupling[ROWS] = 0.f;
    // row r is now pull + gain (row r + 1) + far (the last row of the thread before)
    float gain[ROWS], far[ROWS];
    {
        const float s = 1.f / weight[0];
        pull[0] *= s; gain[0] = coupling[1] * s; far[0] = coupling[0] * s;
    }
    #pragma unroll
    for (int r = 1; r < ROWS - 1; ++r) {
        const float s = 1.f / (weight[r] - coupling[r] * gain[r - 1]);
        pull[r] = (pull[r] + coupling[r] * pull[r - 1]) * s;
        gain[r] = coupling[r + 1] * s;
        far[r] = coupling[r] * far[r - 1] * s;
    }
    // the first row by the thread's last and the last before, which the thread before asks for
    float p = pull[ROWS - 2], g = gain[ROWS - 2], f = far[ROWS - 2];
    #pragma unroll
    for (int r = ROWS - 3; r >= 0; --r) {
        p = pull[r] + gain[r] * p;
        f = far[r] + gain[r] * f;
        g = gain[r] * g;
    }
    p = __shfl_down_sync(all, p, 1, span);
    g = __shfl_down_sync(all, g, 1, span);
    f = __shfl_down_sync(all, f, 1, span);
    const float near = coupling[ROWS - 1], next = coupling[ROWS];
    const float s = 1.f / (weight[ROWS - 1] - near * gain[ROWS - 2] - next * f);
    float low = near * far[ROWS - 2] * s, high = next * g * s;
    float last = (pull[ROWS - 1] + near * pull[ROWS - 2] + next * p) * s;
    for (int shift = 1; shift < span; shift *= 2) {
        const bool down = q >= shift, up = q + shift < span;
        const float lb = __shfl_up_sync(all, low, shift, span), hb = __shfl_up_sync(all, high, shift, span);
        const float pb = __shfl_up_sync(all, last, shift, span), la = __shfl_down_sync(all, low, shift, span);
        const float ha = __shfl_down_sync(all, high, shift, span), pa = __shfl_down_sync(all, last, shift, span);
        // at the ends ``low`` and ``high`` are zero, and what comes from there is finite
        const float s = 1.f / (1.f - (down ? low * hb : 0.f) - (up ? high * la : 0.f));
        last = (last + low * pb + high * pa) * s;
        low = down ? low * lb * s : 0.f;
        high = up ? high * ha * s : 0.f;
    }
    float before = __shfl_up_sync(all, last, 1, span);
    if (q == 0) before = 0.f;
    pull[ROWS - 1] = last;
    #pragma unroll
    for (int r = ROWS - 2; r >= 0; --r) pull[r] = pull[r] + gain[r] * pull[r + 1] + far[r] * before;
    #pragma unroll
    for (int r = 0; r < ROWS; ++r) { ex[r] *= pull[r]; ey[r] *= pull[r]; ez[r] *= pull[r]; }
    float nx = __shfl_down_sync(all, ex[0], 1, span);
    float ny = __shfl_down_sync(all, ey[0], 1, span);
    float nz = __shfl_down_sync(all, ez[0], 1, span);
    if (q == span - 1) { nx = 0.f; ny = 0.f; nz = 0.f; }
    // all have read their vertices before the first shuffle, so that nothing is overwritten too soon
    __syncwarp();
    if (q == 0 && here > 0) {
        x.data[head] += vw[0] * ex[0];
        y.data[head] += vw[0] * ey[0];
        z.data[head] += vw[0] * ez[0];
    }
    #pragma unroll
    for (int r = 0; r < ROWS; ++r) {
        if (q * ROWS + r < here) {
            const int i = head + (q * ROWS + r + 1) * step;
            x.data[i] = again(x.data[i]) + vw[r + 1] * ((r < ROWS - 1 ? ex[(r + 1) % ROWS] : nx) - ex[r]);
            y.data[i] = again(y.data[i]) + vw[r + 1] * ((r < ROWS - 1 ? ey[(r + 1) % ROWS] : ny) - ey[r]);
            z.data[i] = again(z.data[i]) + vw[r + 1] * ((r < ROWS - 1 ? ez[(r + 1) % ROWS] : nz) - ez[r]);
        }
    }
}
#endif
""")
def stretch_grid_lines_by_threads(
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
    count: int,
    grid_lines: int,
    varied: bool,
    rate: float,
    size: int,
):
    """Solve the edges of each grid line of one direction at once and move its vertices.

    The grid lines are equally long, and their vertices equally far apart in memory.

    Args:
        x: Coordinates; so are ``y`` and ``z`` [m].
        y: See ``x``.
        z: See ``x``.
        w: Inverse masses [1/kg].
        compliance: The world's compliances.
        edge: Vertices of the edges, those of one grid line after those of another.
        rest: Their lengths [m].
        scale: What the compliance of each is multiplied with.
        which: The place of each in ``compliance``.
        first: The first edge of the first grid line.
        count: Edges of a grid line, `GRID_LINE_EDGES` at most.
        grid_lines: How many grid lines.
        varied: Whether the edges of a grid line differ in compliance or length.
        rate: 1 / dt^2 [1/s2].
        size: Threads of the block, whole warps.
    """
    ...
