"""What the solver works on, assembled from bodies: flat arrays, colours, contact shapes."""
