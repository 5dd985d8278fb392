"""Elements of cloths and soft bodies as flat arrays: colours, clusters, grid lines, stages. Plain NumPy."""
