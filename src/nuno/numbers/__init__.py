"""Number types of kernels: SIMD lanes, doubles, warps and groups of CUDA blocks, with their arithmetic."""
