"""Plans: how the phases of a substep are launched on a device, and the CUDA and SIMD variants of its loops."""
