"""Tables that a world fills for its solvers: static and kinematic shapes, surfaces, joints."""
