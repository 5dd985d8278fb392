"""Two hands press a soft cube and lift it: how hard must they press?

The task of Howard and Bekey (Autonomous Robots 9, 2000).

Run: python examples/lift_soft_cube.py [--out FOLDER]
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import nuno

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for a picture")
out = options.parse_args().out

cube = nuno.Soft(density=200.0, youngs_modulus=2e4, poisson_ratio=0.3, friction=0.5, damping=0.01)
result = nuno.lift_soft_cube(edge=0.1, cells=4, material=cube)

for squeeze, force, held in zip(result.squeezes, result.forces, result.held, strict=True):
    print(f"{1000 * squeeze:6.3f} mm  " + (f"held with {force:.2f} N" if held else "dropped"))
print(f"least force {result.least_force:.2f} N; Coulomb: m g / (2 mu) = {result.closed_form:.2f} N")
assert abs(result.least_force / result.closed_form - 1.0) < 0.1

if out:
    out.mkdir(parents=True, exist_ok=True)
    figure = Figure(figsize=(5.2, 3.6), layout="constrained")
    axes = figure.subplots()
    for held, mark, label in ((True, "o", "held"), (False, "x", "dropped")):
        chosen = result.held == held
        axes.plot(1000 * result.squeezes[chosen], np.nan_to_num(result.forces[chosen]), mark, label=label)
    axes.axhline(result.closed_form, color="gray", linewidth=1.0, label="m g / (2 mu)")
    axes.set(xlabel="each hand's squeeze [mm]", ylabel="each hand's force [N]")
    axes.legend()
    figure.savefig(out / "lift_soft_cube.png", dpi=100)
