"""Flat regions of a sheet, where nothing can be near itself: squares of its grid that a search on the CPU passes over.

A bound in the spirit of the cone of normals that Volino and Magnenat-Thalmann (1994) put around a patch, but one on
distances. If along some direction each column of a square ends more than a distance before the next begins, then two
elements with a column's gap between them are farther from each other than that. The same goes for rows. An edge, or a
vertex and a triangle, that share no vertex have such a gap, unless both lie in one cell or around a crease's corner:
there the diagonals take the place of the columns.
"""

import warp as wp

from nuno.contact.self.cpu_scratch import ROOM
from nuno.contact.self.simd_tests import PRELUDE
from nuno.topology.leaves import FLAT_SIDE


@wp.func_native(
    PRELUDE
    + ROOM
    + """
const int rows = points / columns;
const float enough = 1.001f * far;
auto load = [](const float* x) { return *(const V*)x; };
for (int q = 0; q <= rows - 3; ++q)
    for (int p = 0; p <= columns - 3; p += 16) {
        const int at = q * columns + p, right = at + 2, left = at + 2 * columns;
        const V dx = load(along_x + right) - load(along_x + left), dy = load(along_y + right) - load(along_y + left);
        const V dz = load(along_z + right) - load(along_z + left), length = dx * dx + dy * dy + dz * dz;
        auto project = [&](int i, int j) {
            const int k = at + j * columns + i;
            return load(along_x + k) * dx + load(along_y + k) * dy + load(along_z + k) * dz;
        };
        // along one diagonal, what the vertices of the others have between them
        const V a = project(0, 1), b = project(1, 2), c = project(0, 0), d = project(1, 1), e = project(2, 2);
        const V f = project(1, 0), g = project(2, 1);
        V gap = minimum(a, b) - project(0, 2);
        gap = minimum(gap, minimum(c, minimum(d, e)) - maximum(a, b));
        gap = minimum(gap, minimum(f, g) - maximum(c, maximum(d, e)));
        gap = minimum(gap, project(2, 0) - maximum(f, g));
        *(I*)(uncreased + at) = gap > __builtin_elementwise_sqrt(length) * enough;
    }
for (int q = 0; q <= rows - FLAT_SIDE; ++q)
    for (int p = 0; p <= columns - FLAT_SIDE; p += 16) {
        const int at = q * columns + p;
        I good = (I){} - 1;
        ROLLED for (int j = 0; j < 3; ++j)
            ROLLED for (int i = 0; i < 3; ++i) good &= *(const I*)(uncreased + at + j * columns + i);
        // from column to column, then from row to row
        ROLLED for (int turn = 0; turn < 2; ++turn) {
            const int step = turn ? columns : 1, other = turn ? 1 : columns;
            // numbers by name: those of an array would be written to memory and read again
            V dx = {}, dy = {}, dz = {};
            ROLLED for (int j = 0; j < FLAT_SIDE; ++j) {
                const int k = at + j * other, beyond = k + (FLAT_SIDE - 1) * step;
                dx += load(along_x + beyond) - load(along_x + k);
                dy += load(along_y + beyond) - load(along_y + k);
                dz += load(along_z + beyond) - load(along_z + k);
            }
            V gap = (V){} + 1e30f, before = (V){} - 2e30f;
            ROLLED for (int i = 0; i < FLAT_SIDE; ++i) {
                V high = (V){} - 1e30f, low = (V){} + 1e30f;
                ROLLED for (int j = 0; j < FLAT_SIDE; ++j) {
                    const int k = at + i * step + j * other;
                    const V s = load(along_x + k) * dx + load(along_y + k) * dy + load(along_z + k) * dz;
                    high = maximum(high, s);
                    low = minimum(low, s);
                }
                gap = minimum(gap, low - before);
                before = high;
            }
            good &= gap > __builtin_elementwise_sqrt(dx * dx + dy * dy + dz * dz) * enough;
        }
        *(I*)(tame + at) = good;
    }
#endif
""".replace("FLAT_SIDE", str(FLAT_SIDE))
)
def survey_world(
    face: wp.array(dtype=wp.vec3i),
    edge: wp.array(dtype=wp.vec2i),
    columns: int,
    points: int,
    leaves: int,
    room: wp.uint64,
    far: float,
):
    """Find the squares of a sheet's grid in which nothing can be near anything that it shares no vertex with."""
    ...
