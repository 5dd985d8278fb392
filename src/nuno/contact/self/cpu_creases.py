"""Creases of one world's sheet that may be near: a search on the CPU tests the others no further.

An edge beside a diagonal is at least as far from it as along the line to the corner that the diagonal leaves out. On a
sheet's grid the creases of a kind lie side by side, so that sixteen cells of a row are looked at without any index.
"""

import warp as wp

from nuno.contact.self.cpu_scratch import CREASE_KINDS, ROOM
from nuno.contact.self.simd_tests import PRELUDE
from nuno.topology.leaves import LOWER_RIGHT, crease_ends

_SIDE = 1 << 10
_ENDS = ", ".join(
    f"{{{low}}}" for low in (
        ", ".join(f"{round(end / _SIDE)} * columns + {end - round(end / _SIDE) * _SIDE}" for end in ends)
        for ends in crease_ends(_SIDE)
    )
)  # fmt: skip


@wp.func_native(
    PRELUDE
    + ROOM
    + """
const int rows = points / columns;
const int ends[][2] = {ENDS};
const V limit = (V){} + far * far;
auto load = [](const float* x) { return *(const V*)x; };
for (int q = 0; q < rows - 1; ++q)
    for (int p = 0; p < columns - 1; p += 16) {
        const int a = q * columns + p, b = a + columns + 1;
        const V ax = load(along_x + a), ay = load(along_y + a), az = load(along_z + a);
        const V dx = load(along_x + b) - ax, dy = load(along_y + b) - ay, dz = load(along_z + b) - az;
        const V square = dx * dx + dy * dy + dz * dz + 1e-20f;
        ROLLED for (int side = 0; side < 2; ++side) {
            // the line to the corner, square to the diagonal
            const int off = side ? a + columns : a + 1;
            V ex = load(along_x + off) - ax, ey = load(along_y + off) - ay, ez = load(along_z + off) - az;
            const V along = (ex * dx + ey * dy + ez * dz) / square;
            ex -= along * dx, ey -= along * dy, ez -= along * dz;
            const V from = ax * ex + ay * ey + az * ez, reach = limit * (ex * ex + ey * ey + ez * ez);
            auto project = [&](int k) {
                return load(along_x + k) * ex + load(along_y + k) * ey + load(along_z + k) * ez;
            };
            ROLLED for (int kind = side ? LOWER_RIGHT : 0; kind < (side ? CREASE_KINDS : LOWER_RIGHT); ++kind) {
                const V gap = minimum(project(a + ends[kind][0]), project(a + ends[kind][1])) - from;
                *(I*)(creased + kind * points + a) = gap * maximum(gap, -gap) <= reach;
            }
        }
    }
#endif
""".replace("ENDS", _ENDS)
    .replace("CREASE_KINDS", str(CREASE_KINDS))
    .replace("LOWER_RIGHT", str(LOWER_RIGHT))
)
def mark_creases(
    face: wp.array(dtype=wp.vec3i),
    edge: wp.array(dtype=wp.vec2i),
    columns: int,
    points: int,
    leaves: int,
    room: wp.uint64,
    far: float,
):
    """Mark those creases of each kind that may be nearer than ``far`` [m]."""
    ...
