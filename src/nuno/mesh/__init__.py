"""Triangle meshes: those of the primitive shapes, sheets, and meshes read from files."""
