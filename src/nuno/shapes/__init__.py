"""Shapes, coordinates and paths: what a body is made of, and where it is. No Warp."""
