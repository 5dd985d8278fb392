"""The XPBD core: Warp kernels by constraint, and the plans that launch them. It knows nothing of World."""
