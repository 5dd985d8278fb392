"""The scratch room in which the CPU lists the pairs of one world, and what stands ready there before the search."""

import warp as wp

from nuno.contact.self.simd_tests import PRELUDE
from nuno.topology.leaves import MAX_REGION, MIN_REGION, REGIONS, crease_ends

CREASE_KINDS = len(crease_ends(1))

# Where a world's scratch numbers stand, from `room` on: positions by fours and by coordinate, whether the squares at a
# vertex are tame and the creases of each kind near, spheres and corners of triangles, middles, halves and ends of
# edges, boxes of leaves and of groups of sixteen leaves, then triangles and edges once more, those near a leaf. Loads
# of sixteen may reach beyond a row's last number.
ROOM = """
const int F = face.shape[0], E = edge.shape[0];
const int faces = (F + 15) / 16 * 16 + 16, edges = (E + 15) / 16 * 16 + 16;
const int leaves_16 = (leaves + 15) / 16, boxes = 16 * leaves_16, groups = (leaves_16 + 15) / 16 * 16;
float* point = (float*)room;
const int row = points + 32;
float *along_x = point + 4 * points, *along_y = along_x + row, *along_z = along_y + row;
int *tame = (int*)(along_z + row), *uncreased = tame + row, *creased = uncreased + row;
float* ball = (float*)(creased + CREASE_KINDS * points + 16);
int* corner = (int*)(ball + 4 * faces);
float* rod = (float*)(corner + 3 * faces);
int* end = (int*)(rod + 6 * edges);
float* box = (float*)(end + 2 * edges);
float* group = box + 6 * boxes;
float* near_ball = group + 6 * groups;
int *near_corner = (int*)(near_ball + 4 * faces), *near_face = near_corner + 3 * faces;
float* near_rod = (float*)(near_face + faces);
int *near_end = (int*)(near_rod + 6 * edges), *near_edge = near_end + 2 * edges;
""".replace("CREASE_KINDS", str(CREASE_KINDS))


def listing_room(points: int, faces: int, edges: int, leaves: int) -> int:
    """Return how many numbers the scratch room of `list_world` has."""
    whole = [-(-count // 16) * 16 for count in (faces, edges, leaves)]
    groups = -(-whole[2] // 256) * 16
    of_points = (4 + CREASE_KINDS) * points + 16 + 5 * (points + 32)
    return of_points + 15 * (whole[0] + 16) + 17 * (whole[1] + 16) + 6 * whole[2] + 6 * groups


@wp.func_native(
    PRELUDE
    + """
const float *x0 = (const float*)x, *y0 = (const float*)y, *z0 = (const float*)z;
float *to = (float*)room, *coordinate = to + 4 * points;
float* kept = (float*)reference;
for (int i = 0; i < points; ++i) {
    const int k = i * lanes;
    kept[k] = to[4 * i] = coordinate[i] = x0[k];
    kept[k + points * lanes] = to[4 * i + 1] = coordinate[points + 32 + i] = y0[k];
    kept[k + 2 * points * lanes] = to[4 * i + 2] = coordinate[2 * (points + 32) + i] = z0[k];
    to[4 * i + 3] = 0.f;
}
#endif
"""
)
def copy_world(
    x: wp.uint64, y: wp.uint64, z: wp.uint64, reference: wp.uint64, lanes: int, points: int, room: wp.uint64
):
    """Copy a world's positions, every ``lanes``-th number, to ``room``, and note them as those of the list."""
    ...


@wp.func_native(
    PRELUDE
    + ROOM
    + """
const float third = 1.f / 3.f;
for (int j = 0; j < F; j += 16) {
    const I row = smaller(OWN + j, F - 1) * 3;
    V px[3], py[3], pz[3];
    for (int c = 0; c < 3; ++c) {
        const I i = take_int((const int*)face.data + c, row);
        *(I*)(corner + c * faces + j) = i;
        px[c] = take(point, i * 4);
        py[c] = take(point + 1, i * 4);
        pz[c] = take(point + 2, i * 4);
    }
    const V mx = (px[0] + px[1] + px[2]) * third, my = (py[0] + py[1] + py[2]) * third;
    const V mz = (pz[0] + pz[1] + pz[2]) * third;
    V far = {};
    for (int c = 0; c < 3; ++c) {
        const V dx = px[c] - mx, dy = py[c] - my, dz = pz[c] - mz;
        far = maximum(far, dx * dx + dy * dy + dz * dz);
    }
    *(V*)(ball + j) = mx;
    *(V*)(ball + faces + j) = my;
    *(V*)(ball + 2 * faces + j) = mz;
    *(V*)(ball + 3 * faces + j) = __builtin_elementwise_sqrt(far);
}
for (int j = 0; j < E; j += 16) {
    const I row = smaller(OWN + j, E - 1) * 2;
    const I a = take_int((const int*)edge.data, row), b = take_int((const int*)edge.data + 1, row);
    *(I*)(end + j) = a;
    *(I*)(end + edges + j) = b;
    const V x = take(point, a * 4), y = take(point + 1, a * 4), z = take(point + 2, a * 4);
    const V dx = (take(point, b * 4) - x) * .5f, dy = (take(point + 1, b * 4) - y) * .5f;
    const V dz = (take(point + 2, b * 4) - z) * .5f;
    *(V*)(rod + j) = x + dx;
    *(V*)(rod + edges + j) = y + dy;
    *(V*)(rod + 2 * edges + j) = z + dz;
    *(V*)(rod + 3 * edges + j) = dx;
    *(V*)(rod + 4 * edges + j) = dy;
    *(V*)(rod + 5 * edges + j) = dz;
}
for (int b = 0; b < boxes; ++b) {
    // beyond the last leaf stand boxes that meet nothing
    Q low = (Q){} + 1e30f, high = (Q){} - 1e30f;
    if (b < leaves)
        for (int k = leaf_corner_start.data[b]; k < leaf_corner_start.data[b + 1]; ++k) {
            const Q p = *(const Q*)(point + 4 * leaf_corner.data[k]);
            low = (Q)((p < low) ? (J)p : (J)low);
            high = (Q)((p > high) ? (J)p : (J)high);
        }
    for (int c = 0; c < 3; ++c) {
        box[c * boxes + b] = low[c];
        box[(c + 3) * boxes + b] = high[c];
    }
}
for (int g = 0; g < groups; ++g)
    for (int c = 0; c < 6; ++c) {
        float value = c < 3 ? 1e30f : -1e30f;
        if (g < leaves_16) {
            const V row = *(const V*)(box + c * boxes + 16 * g);
            value = c < 3 ? __builtin_reduce_min(row) : __builtin_reduce_max(row);
        }
        group[c * groups + g] = value;
    }
int side = leaves / REGIONS < MIN_REGION ? MIN_REGION : leaves / REGIONS;
if (side > MAX_REGION) side = MAX_REGION;
for (int r = 0; r * side < leaves; ++r)
    for (int c = 0; c < 6; ++c) {
        // boxes beyond the last leaf change nothing
        const int last = (r + 1) * side < boxes ? (r + 1) * side : boxes;
        const float* of = box + c * boxes;
        float value = of[r * side];
        for (int b = r * side + 1; b < last; ++b) value = (c < 3) == (of[b] < value) ? of[b] : value;
        ((float*)bounds)[(6 * r + c) * lanes] = value;
    }
#endif
""".replace("MIN_REGION", str(MIN_REGION))
    .replace("MAX_REGION", str(MAX_REGION))
    .replace("REGIONS", str(REGIONS))
)
def bound_world(
    face: wp.array(dtype=wp.vec3i),
    edge: wp.array(dtype=wp.vec2i),
    leaf_corner: wp.array(dtype=int),
    leaf_corner_start: wp.array(dtype=int),
    points: int,
    leaves: int,
    room: wp.uint64,
    lanes: int,
    bounds: wp.uint64,
):
    """Spheres around all triangles, halves of edges, boxes around all leaves, sixteens of them and regions.

    The regions' boxes are noted too, every ``lanes``-th number, for `nuno.contact.self.list_rebuild` to ask later.
    """
    ...
