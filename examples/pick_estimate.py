"""At which point was this cloth picked up? The bundled case: an image before, an image after, and the hand.

Run: python examples/pick_estimate.py [folder for result.json and result.png]

One coarse mesh and a few guesses at the material answer in seconds; without ``discretisations`` the estimate
takes finer meshes and more guesses, as ``python -m nuno pick`` does.
"""

import sys
from pathlib import Path

import nuno
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation

CASE = Path(__file__).parent / "pick-case"
TRUE = (0, 0)  # where this cloth was picked, in the simulation that its images were rendered from

case = nuno.read_case(CASE)
quick = Discretisation(cells=15, substeps=12, hypotheses=HYPOTHESES[1::2])
result = case.estimate(candidates=(6, 6), discretisations=[quick], device="cpu", progress=False)

print(f"cloth of {result.rectangle.long_m * 100:.1f} x {result.rectangle.short_m * 100:.1f} cm")
for i, j, score in result.ranking[:3]:
    print(f"({i}, {j}): outline {-score:.1f} px off")
print(f"confidence {result.confidence:.2f}, in {result.seconds['total']:.1f} s {result.warnings or ''}")
if len(sys.argv) > 1:
    result.save(sys.argv[1])

world = result.adopt()  # the world in which the cloth hangs as it most likely does
cloth = world.find("cloth")
lowest, highest = cloth.vertices[:, 2].min(), cloth.vertices[:, 2].max()
print(f"it hangs from {highest:.2f} m down to {lowest:.2f} m; the table is at {case.table_height:.2f} m")

assert result.best == TRUE and not result.warnings
assert abs(highest - case.hand[2]) < 0.02 and lowest > case.table_height
