"""Cameras: pinhole geometry, offscreen rendering, and finding the cloth in images."""
