"""Scenes of other programs: MJCF, URDF and USD into bodies of a world, and worlds into MJCF and USD."""
