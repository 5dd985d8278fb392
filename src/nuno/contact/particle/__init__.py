"""Contact of particles, edges and triangles with static and kinematic shapes."""
