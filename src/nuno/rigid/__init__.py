"""Rigid bodies: convex parts, broad phase, contact manifolds, and the passes of a substep."""
