"""The state of particles on the device, and the prediction and velocities of a substep."""
