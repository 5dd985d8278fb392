"""Files: recordings, meshes, animations, and files that appear whole or not at all."""
