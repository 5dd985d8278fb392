"""The face of a convex hull whose plane a point is farthest above, found in a grid around the hull.

Each cell of the grid has the planes that may be the highest anywhere in it, some tenth of all. It is exact, so that it
does not matter which worlds are looked at together: what has no list is compared with all planes.
"""

import warp as wp

from nuno.contact.particle.hull import FAR
from nuno.numbers.lanes import LANES, lane
from nuno.numbers.vec3 import LaneVec3, Vec3, vec3
from nuno.state.cloth_state import Shapes


@wp.func
def higher(best: wp.vec4, f: wp.vec4, x: float, y: float, z: float):
    """Height and normal of the higher of two planes."""
    own = x * f[0] + y * f[1] + z * f[2] - f[3]
    if own > best[0]:
        return wp.vec4(own, f[0], f[1], f[2])
    return best


@wp.func
def top_of(shapes: Shapes, s: int, x: float, y: float, z: float):
    """Height [m] of a point above the plane that it is the farthest above, and that plane's normal, as 4 numbers."""
    best = wp.vec4(-FAR, 0.0, 0.0, 1.0)
    begin = int(0)
    end = int(0)
    ends = shapes.faces[s]
    grid = shapes.hull_grid[s]
    if grid[1] > 0:
        low = shapes.hull_low[s]
        i = int(wp.floor((x - low[0]) * low[3]))
        j = int(wp.floor((y - low[1]) * low[3]))
        k = int(wp.floor((z - low[2]) * low[3]))
        if i >= 0 and j >= 0 and k >= 0 and i < grid[1] and j < grid[2] and k < grid[3]:
            cell = grid[0] + (i * grid[2] + j) * grid[3] + k
            begin = shapes.cell_ends[cell]
            end = shapes.cell_ends[cell + 1]
    if begin < end:
        for c in range(begin, end):
            best = higher(best, shapes.planes[ends[0] + shapes.cell_planes[c]], x, y, z)
    else:
        for f in range(ends[0], ends[1]):
            best = higher(best, shapes.planes[f], x, y, z)
    return best


@wp.func
def top_plane(shapes: Shapes, s: int, p: Vec3, within: float):
    """`top_of` one world's point; of many, of those where ``within`` is positive, and the others are far away."""
    best = top_of(shapes, s, p.x, p.y, p.z)
    return best[0], vec3(best[1], best[2], best[3])


@wp.func
def top_plane(shapes: Shapes, s: int, p: LaneVec3, within: lane):
    height = lane()
    nx = lane()
    ny = lane()
    nz = lane()
    lanes = int(LANES)  # a variable: the loop stays a loop
    for k in range(lanes):
        best = wp.vec4(FAR, 0.0, 0.0, 1.0)
        if within[k] > 0.0:
            best = top_of(shapes, s, p.x[k], p.y[k], p.z[k])
        height[k] = best[0]
        nx[k] = best[1]
        ny[k] = best[2]
        nz[k] = best[3]
    return height, vec3(nx, ny, nz)
