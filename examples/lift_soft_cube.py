"""Two hands press a soft cube and lift it: how hard must they press?

The task of Howard and Bekey (Autonomous Robots 9, 2000).

Run: python examples/lift_soft_cube.py
"""

import nuno

cube = nuno.Soft(density=200.0, youngs_modulus=2e4, poisson_ratio=0.3, friction=0.5, damping=0.01)
result = nuno.lift_soft_cube(edge=0.1, cells=4, material=cube)

for squeeze, force, held in zip(result.squeezes, result.forces, result.held, strict=True):
    print(f"{1000 * squeeze:6.3f} mm  " + (f"held with {force:.2f} N" if held else "dropped"))
print(f"least force {result.least_force:.2f} N; Coulomb: m g / (2 mu) = {result.closed_form:.2f} N")
assert abs(result.least_force / result.closed_form - 1.0) < 0.1
