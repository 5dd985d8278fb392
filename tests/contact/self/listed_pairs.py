"""The pairs that a cloth's neighbour list has."""


def listed_pairs(solver, world):
    """Return the vertices of a world's listed vertex-triangle and edge-edge candidates, (k, 4) int each."""
    state, size, rows = solver.state, solver._size, []
    kinds = ((state.vertex_triangle, size.vertex_triangle), (state.edge_edge, size.edge_edge))
    for (array, room), count in zip(kinds, solver.pair_counts[world], strict=True):
        numbers = array.numpy().ravel()[4 * room * world : 4 * room * (world + 1)]
        by_pair = solver._cuda or solver.plan == "grid"
        rows.append((numbers.reshape(room, 4) if by_pair else numbers.reshape(4, room).T)[:count])
    return rows
