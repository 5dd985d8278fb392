"""Functions that the compiler for the CPU is to leave out of line: long ones that are called often in the source.

Everything would be put into one kernel, some of it several times: `nuno.numbers.lanes.per_world` in 25 places, the
distance to a box in five. Most of these functions run once a frame, or for the few particles near an edge; the rest is
so long that a call does not count. What it brings and costs: docs/reports/profiles.md.
"""

OUT_OF_LINE = frozenset(
    f"nuno.{module}.{name}"
    for module, names in {
        "constraints.damping": ("damp_bends",),
        "constraints.grips": ("key_position", "pull_points", "read_loads"),
        "constraints.membrane": ("stretch_grid_line",),
        "contact.particle.distances": ("distance_box", "distance_solid", "gap_mesh", "mesh_gap"),
        "contact.particle.feature_contact": ("find_active_features", "push_active", "push_elements"),
        "contact.particle.feature_lists": ("mark_features", "stands_between"),
        "contact.particle.feature_points": (
            "across_edge", "edge_point", "outermost", "past_box_edge", "triangle_point",
        ),
        "contact.particle.feature_pose": ("measured",),
        "contact.particle.hull": ("distance_hull", "meets_ridges", "outermost_corner", "way_into_hull"),
        "contact.particle.hull_grid": ("top_of",),
        "contact.particle.hull_ridges": ("hull_edge_point",),
        "contact.particle.kinematic_pose": ("kinematic_position", "kinematic_rotation"),
        "contact.particle.shape_contact": ("select_shapes",),
        "contact.self.list_rebuild": ("rebuild_lists",),
        "contact.self.narrow_phase": ("closest_on_edges",),
        "numbers.lanes": ("per_world",),
    }.items()
    for name in names
)  # fmt: skip
"""Their modules and names."""
