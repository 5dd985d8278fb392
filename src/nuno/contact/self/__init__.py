"""Contact of a cloth with itself: broad phase, neighbour lists, narrow phase, response."""
