"""Contact: static shapes against particles, and cloth against itself."""
