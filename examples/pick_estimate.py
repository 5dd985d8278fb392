"""At which point was this cloth picked up? The bundled case: an image before, an image after, and the hand.

Run: python examples/pick_estimate.py [--out FOLDER]

One coarse mesh and a few guesses at the material answer in seconds; without ``discretisations`` the estimate
takes finer meshes and more guesses, as ``python -m nuno pick`` does.
"""

import argparse
from pathlib import Path

import nuno
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation

CASE = Path(__file__).parent / "pick-case"
TRUE = (0, 0)  # where this cloth was picked, in the simulation that its images were rendered from

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for result.json and result.png")
out = options.parse_args().out

case = nuno.read_case(CASE)
quick = Discretisation(cells=15, substeps=12, hypotheses=HYPOTHESES[1::2])
result = case.estimate(candidates=(6, 6), discretisations=[quick], device="cpu", progress=False)

print(f"cloth of {result.rectangle.long_m * 100:.1f} x {result.rectangle.short_m * 100:.1f} cm")
for k in result.order[:3]:
    name = result.score_name.replace("_", " ")
    print(f"{tuple(result.labels[k].tolist())}: {name} {result.scores[k]:.1f}, eq. (1) {result.eq1[k]:.4f}")
print(f"confidence {result.confidence:.2f}, in {result.seconds['total']:.1f} s {result.warnings or ''}")
if out:
    result.save(out)

world = result.adopt()  # the world in which the cloth hangs as it most likely does
cloth = world.find("cloth")
lowest, highest = cloth.vertices[:, 2].min(), cloth.vertices[:, 2].max()
print(f"it hangs from {highest:.2f} m down to {lowest:.2f} m; the table is at {case.table_height:.2f} m")

assert result.best == TRUE and not result.warnings
assert abs(highest - case.hand[2]) < 0.02 and lowest > case.table_height
