"""Phases of a substep that the compiler for the CPU is to leave out of line.

It would put everything into one function of 100,000 lines and more, on which it takes longer than on its parts. What is
listed here is long and takes no lanes by value, so that a call does not count beside what it does. What it brings and
costs: docs/reports/profiles.md.
"""

OUT_OF_LINE = frozenset(
    f"nuno.{module}.{name}"
    for module, names in {
        "constraints.damping": ("damp_bends",),
        "constraints.grips": ("hold_vertices", "pull_points", "read_loads"),
        "contact.particle.distances": ("mesh_gap",),
        "contact.particle.feature_lists": ("mark_features", "slack_of"),
        "contact.particle.hull": ("outermost_corner",),
        "contact.particle.hull_grid": ("top_of",),
        "contact.particle.hull_ridges": ("hull_edge_point",),
        "contact.particle.shape_contact": ("select_shapes", "touch_shape"),
        "contact.self.cpu_search": ("list_world",),
        "contact.self.list_rebuild": ("measure_moves", "rebuild_lists"),
        "contact.self.self_contact": ("take_moves", "touch_edge_edge", "touch_vertex_triangle"),
        "plans.cloth_elastic": ("bend_sheet", "sweep_membrane"),
        "state.integrate": ("predict",),
    }.items()
    for name in names
)
"""Their modules and names."""
