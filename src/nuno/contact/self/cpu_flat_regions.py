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
const float* along[3] = {along_x, along_y, along_z};
auto project = [&](int k, const V* d) ALONE {
    return *(const V*)(along_x + k) * d[0] + *(const V*)(along_y + k) * d[1] + *(const V*)(along_z + k) * d[2];
};
for (int q = 0; q <= rows - 3; ++q)
    for (int p = 0; p <= columns - 3; p += 16) {
        const int at = q * columns + p;
        V d[3], length = {}, high[5], low[5];
        ROLLED for (int c = 0; c < 3; ++c) {
            d[c] = *(const V*)(along[c] + at + 2) - *(const V*)(along[c] + at + 2 * columns);
            length += d[c] * d[c];
        }
        // along one diagonal, what the vertices of the others have between them
        ROLLED for (int k = 0; k < 5; ++k) high[k] = (V){} - 1e30f, low[k] = (V){} + 1e30f;
        ROLLED for (int j = 0; j < 3; ++j)
            ROLLED for (int i = 0; i < 3; ++i) {
                const V s = project(at + j * columns + i, d);
                high[i - j + 2] = maximum(high[i - j + 2], s);
                low[i - j + 2] = minimum(low[i - j + 2], s);
            }
        V gap = low[1] - high[0];
        ROLLED for (int k = 1; k < 4; ++k) gap = minimum(gap, low[k + 1] - high[k]);
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
            V d[3], length = {};
            ROLLED for (int c = 0; c < 3; ++c) {
                d[c] = (V){};
                ROLLED for (int j = 0; j < FLAT_SIDE; ++j) {
                    const float* x = along[c] + at + j * other;
                    d[c] += *(const V*)(x + (FLAT_SIDE - 1) * step) - *(const V*)x;
                }
                length += d[c] * d[c];
            }
            V gap = (V){} + 1e30f, before = (V){} - 2e30f;
            ROLLED for (int i = 0; i < FLAT_SIDE; ++i) {
                V high = (V){} - 1e30f, low = (V){} + 1e30f;
                ROLLED for (int j = 0; j < FLAT_SIDE; ++j) {
                    const V s = project(at + i * step + j * other, d);
                    high = maximum(high, s);
                    low = minimum(low, s);
                }
                gap = minimum(gap, low - before);
                before = high;
            }
            good &= gap > __builtin_elementwise_sqrt(length) * enough;
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
