"""Humanoids: models on Pinocchio, their links as bodies in a world, and inverse kinematics."""
