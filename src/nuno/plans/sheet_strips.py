"""A sheet's bends and shears by warps on CUDA: each thread has a few vertices in its registers.

Elements of one colour share no vertex. Taken colour by colour, every vertex is read and written again for each, with
what tables say of each element, and all threads of the block wait in between. Here a warp takes lines of the grid, or
strips between two lines, through all colours that stay in them. A thread has six vertices of a line, or two of either
line of a strip, and hands on what lies between it and its neighbours. The order of the elements is that of the colours,
and where a material is the same everywhere nothing is read of tables but a number or two.
"""

import warp as wp

from nuno.constraints.compliances import UNIFORM_BENDS
from nuno.numbers.lanes import barrier
from nuno.state.cloth_state import Settings, StateFloat, Topology

STRIP_COLUMNS, LINE_VERTICES = wp.constant(64), wp.constant(192)
"""Vertices of the longest strip and of the longest line that the 32 threads of a warp take together."""
BEND_KINDS = wp.constant(UNIFORM_BENDS)

_BEGIN = """
#if defined(__CUDA_ARCH__)
const unsigned all = 0xffffffffu;
const int lane = threadIdx.x % 32, warp = threadIdx.x / 32, warps = size / 32;
struct Vertex { float x, y, z, w; int i; };
auto read = [&](int i) { return Vertex{x.data[i], y.data[i], z.data[i], w.data[i], i}; };
auto write = [&](const Vertex& v) { x.data[v.i] = v.x; y.data[v.i] = v.y; z.data[v.i] = v.z; };
// the vertex v of the next thread, or of the one before
auto from_next = [&](const Vertex& v, int i, float w) {
    return Vertex{__shfl_down_sync(all, v.x, 1), __shfl_down_sync(all, v.y, 1), __shfl_down_sync(all, v.z, 1), w, i};
};
auto from_last = [&](const Vertex& v, int i, float w) {
    return Vertex{__shfl_up_sync(all, v.x, 1), __shfl_up_sync(all, v.y, 1), __shfl_up_sync(all, v.z, 1), w, i};
};
// the quotient of two counts, of which none is large
auto share = [&](int a, int b) { return (int)((a + 0.5f) / b); };
auto move = [&](Vertex& v, float dx, float dy, float dz, float s) { v.x += dx * s; v.y += dy * s; v.z += dz * s; };
"""
_STRIPS = (
    _BEGIN
    + """
// nuno.constraints.PROJECTION
CONSTRAINT
const int across = columns - 1, span = (columns + 1) / 2, each = share(32, span), strips = (rows - odd) / 2;
const int part = share(lane, span), q = lane - part * span;
// where cells of either colour start among all, and how many of them a strip has
const int begin[2] = {colour.data[2 * odd], colour.data[2 * odd + 1]}, length[2] = {(across + 1) / 2, across / 2};
for (int first = warp * each; first < strips; first += warps * each) {
    const int s = first + part;
    const bool on = part < each && s < strips;
    const int here = (2 * (on ? s : first) + odd) * columns + 2 * q;
    const bool two = on && 2 * q + 1 < columns, linked = on && 2 * q + 2 < columns;
    Vertex a = read(here), b = read(two ? here + 1 : here);
    Vertex c = read(here + columns), d = read(two ? here + columns + 1 : here + columns);
    const float wa = w.data[linked ? here + 2 : here], wc = w.data[linked ? here + columns + 2 : here];
    float first_alpha = same, second_alpha = same;
    if (__builtin_expect(varied, false)) {
        if (two) first_alpha = soften(begin[0] + s * length[0] + q);
        if (linked) second_alpha = soften(begin[1] + s * length[1] + q);
    }
    if (two) project(a, b, c, d, first_alpha);
    Vertex e = from_next(a, here + 2, wa), f = from_next(c, here + columns + 2, wc);
    if (linked) project(b, e, d, f, second_alpha);
    e = from_last(e, a.i, a.w);
    f = from_last(f, c.i, c.w);
    if (on) {
        // the thread before has moved them on
        write(q > 0 ? e : a);
        write(q > 0 ? f : c);
        if (two) { write(b); write(d); }
    }
}
#endif
"""
)
_TWIST = """
auto soften = [&](int k) { return compliance.data[which.data[k]] * (scale.data[k] * rate); };
auto project = [&](Vertex& a, Vertex& b, Vertex& c, Vertex& d, float alpha) {
    float cx = a.x - b.x - c.x + d.x, cy = a.y - b.y - c.y + d.y, cz = a.z - b.z - c.z + d.z;
    float weight = a.w + b.w + c.w + d.w;
    const float s = -1.f / (fmaxf(weight * 0.5f + alpha, weight * 0.8f) + 1.0e-12f);
    move(a, cx, cy, cz, s * a.w);
    move(b, cx, cy, cz, -s * b.w);
    move(c, cx, cy, cz, -s * c.w);
    move(d, cx, cy, cz, s * d.w);
};
"""
_SHEAR = """
const float quarter = scale.data[0];
auto soften = [&](int k) { return compliance.data[which.data[k]] * (quarter * 4.f * rate); };
auto project = [&](Vertex& a, Vertex& b, Vertex& c, Vertex& d, float alpha) {
    const float d1x = d.x - a.x, d1y = d.y - a.y, d1z = d.z - a.z;
    const float d2x = b.x - c.x, d2y = b.y - c.y, d2z = b.z - c.z;
    const float q1 = d1x * d1x + d1y * d1y + d1z * d1z, q2 = d2x * d2x + d2y * d2y + d2z * d2z;
    const float gradient = (a.w + d.w) * q1 + (b.w + c.w) * q2;
    const float weight = gradient * (quarter * 4.f * quarter) + alpha + 1.0e-12f;
    const float s = (q1 - q2) * quarter / weight * (quarter * 2.f);
    move(a, d1x, d1y, d1z, s * a.w);
    move(d, d1x, d1y, d1z, -s * d.w);
    move(b, d2x, d2y, d2z, s * b.w);
    move(c, d2x, d2y, d2z, -s * c.w);
};
"""


@wp.func_native(_STRIPS.replace("CONSTRAINT", _TWIST).replace("PROJECTION", "bending.bend_twist"))
def twist_strips(
    x: wp.array(dtype=float),
    y: wp.array(dtype=float),
    z: wp.array(dtype=float),
    w: wp.array(dtype=float),
    compliance: wp.array(dtype=float),
    scale: wp.array(dtype=float),
    which: wp.array(dtype=int),
    colour: wp.array(dtype=int),
    columns: int,
    rows: int,
    odd: int,
    same: float,
    varied: bool,
    rate: float,
    size: int,
):
    """The twists of the cells in every other strip between two rows of a sheet: of two colours.

    Args:
        x: Coordinates; so are ``y`` and ``z`` [m].
        y: See ``x``.
        z: See ``x``.
        w: Inverse masses [1/kg].
        compliance: The world's compliances.
        scale: What the compliance of each element is multiplied with.
        which: The place of each in ``compliance``.
        colour: Where the colours start.
        columns: Vertices in a row, `STRIP_COLUMNS` at most.
        rows: Rows of vertices.
        odd: Whether the first strip is that after row 1, instead of row 0.
        same: The compliance of all over dt^2, where they do not differ.
        varied: Whether they do.
        rate: 1 / dt^2 [1/s2].
        size: Threads of the block, whole warps.
    """
    ...


@wp.func_native(_STRIPS.replace("CONSTRAINT", _SHEAR).replace("PROJECTION", "membrane.shear_cell"))
def shear_strips(
    x: wp.array(dtype=float),
    y: wp.array(dtype=float),
    z: wp.array(dtype=float),
    w: wp.array(dtype=float),
    compliance: wp.array(dtype=float),
    scale: wp.array(dtype=float),
    which: wp.array(dtype=int),
    colour: wp.array(dtype=int),
    columns: int,
    rows: int,
    odd: int,
    same: float,
    varied: bool,
    rate: float,
    size: int,
):
    """The shears of the same cells; for the arguments see `twist_strips`."""
    ...


@wp.func_native(
    _BEGIN
    + """
// nuno.constraints.bending.bend_line
auto soften = [&](int k) { return compliance.data[which.data[k]] * (scale.data[k] * rate); };
auto project = [&](Vertex& a, Vertex& b, Vertex& c, float alpha) {
    float cx = a.x - b.x * 2.f + c.x, cy = a.y - b.y * 2.f + c.y, cz = a.z - b.z * 2.f + c.z;
    float weight = a.w + b.w * 4.f + c.w;
    const float s = -1.f / (fmaxf(weight * 0.5f + alpha, weight * 0.8f) + 1.0e-12f);
    move(a, cx, cy, cz, s * a.w);
    move(b, cx, cy, cz, s * b.w * -2.f);
    move(c, cx, cy, cz, s * c.w);
};
const int length = upright ? rows : columns, lines = upright ? columns : rows;
const int along = upright ? columns : 1, across = upright ? 1 : columns;
const int span = (length + 5) / 6, each = share(32, span), side = share(lane, span), q = lane - side * span;
// a line's bend of a colour, the one so many after its first, among all
auto number = [&](int c, int part, int line) {
    const int count = (length + 1 - (c == 0 ? 3 : c)) / 3;
    return colour.data[3 * upright + c] + (upright ? part * lines + line : line * count + part);
};
for (int first = warp * each; first < lines; first += warps * each) {
    const int line = first + side;
    const bool on = side < each && line < lines;
    const int here = (on ? line : first) * across + 6 * q * along, left = on ? length - 6 * q : 0;
    // lines at the rim are half as wide
    const float same = scale.data[number(1, 0, on ? line : first)] * rate * give;
    Vertex v[6];
    float alpha[6];
    #pragma unroll
    for (int r = 0; r < 6; ++r) {
        v[r] = read(here + (r < left ? r * along : 0));
        alpha[r] = same;
    }
    if (__builtin_expect(varied, false)) {
        #pragma unroll
        for (int r = 0; r < 6; ++r)
            if (r + 1 < left && q + r > 0) alpha[r] = soften(number(r % 3, 2 * q + r / 3 - (r % 3 == 0), line));
    }
    const float wl = w.data[q > 0 ? here - along : here], wn = w.data[left > 6 ? here + 6 * along : here];
    Vertex e = from_last(v[5], here - along, wl);
    if (q > 0 && left > 1) project(e, v[0], v[1], alpha[0]);
    if (left > 4) project(v[2], v[3], v[4], alpha[3]);
    e = from_next(e, v[5].i, v[5].w);
    // the next thread has moved it where it has a bend there
    if (left > 7) v[5] = e;
    if (left > 2) project(v[0], v[1], v[2], alpha[1]);
    if (left > 5) project(v[3], v[4], v[5], alpha[4]);
    if (left > 3) project(v[1], v[2], v[3], alpha[2]);
    e = from_next(v[0], here + 6 * along, wn);
    if (left > 6) project(v[4], v[5], e, alpha[5]);
    e = from_last(e, v[0].i, v[0].w);
    if (q > 0) v[0] = e;
    #pragma unroll
    for (int r = 0; r < 6; ++r)
        if (r < left) write(v[r]);
}
#endif
"""
)
def bend_strips(
    x: wp.array(dtype=float),
    y: wp.array(dtype=float),
    z: wp.array(dtype=float),
    w: wp.array(dtype=float),
    compliance: wp.array(dtype=float),
    scale: wp.array(dtype=float),
    which: wp.array(dtype=int),
    colour: wp.array(dtype=int),
    columns: int,
    rows: int,
    upright: int,
    give: float,
    varied: bool,
    rate: float,
    size: int,
):
    """The bends along all rows, or where ``upright`` along all columns, of `LINE_VERTICES` vertices at most.

    ``give`` is the compliance of all, less their scale, where they do not differ. For the others see `twist_strips`.
    """
    ...


@wp.func
def fits_strips(table: Topology):
    """Return whether a cloth is a sheet whose strips a warp has threads for."""
    columns = table.columns
    return columns > 0 and columns <= STRIP_COLUMNS and table.particles <= LINE_VERTICES * columns


@wp.func
def bend_in_strips(t: StateFloat, table: Topology, run: Settings, size: int):
    """All twists, bends and shears of a sheet that `fits_strips`, as `nuno.plans.cloth_substep.bend_sheet` has them."""
    columns = table.columns
    rows = table.particles / columns
    rate = 1.0 / (run.dt * run.dt)
    varied = t.bend_compliance.shape[0] > BEND_KINDS
    # early, for it comes from far away
    twist = t.bend_compliance[table.twist_compliance[0]] * (table.twist_scale[0] * rate)
    shear = t.shear_compliance[table.cell_compliance[0]] * (table.cell_scale[0] * 4.0 * rate)
    halves = int(2)  # a variable, or Warp would unroll the loops
    for odd in range(halves):
        twist_strips(
            t.x, t.y, t.z, t.w, t.bend_compliance, table.twist_scale, table.twist_compliance,
            table.twist_colour, columns, rows, odd, twist, varied, rate, size,
        )  # fmt: skip
        barrier(size)
    for upright in range(halves):
        give = t.bend_compliance[table.line_compliance[table.line_colour[3 * upright]]]
        bend_strips(
            t.x, t.y, t.z, t.w, t.bend_compliance, table.line_scale, table.line_compliance,
            table.line_colour, columns, rows, upright, give, varied, rate, size,
        )  # fmt: skip
        barrier(size)
    if run.sweeps > 0:
        halves = 0
    for odd in range(halves):
        shear_strips(
            t.x, t.y, t.z, t.w, t.shear_compliance, table.cell_scale, table.cell_compliance,
            table.cell_colour, columns, rows, odd, shear, t.shear_compliance.shape[0] > 1, rate, size,
        )  # fmt: skip
        barrier(size)
