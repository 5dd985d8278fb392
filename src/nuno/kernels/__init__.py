"""Kernels as Warp compiles them: which there are, compiled ahead, and what compiling takes in a run."""
