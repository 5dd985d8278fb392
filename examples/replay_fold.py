"""How does a cloth lie that two hands have folded? The bundled case: a video, the hands' paths, and one camera.

Run: python examples/replay_fold.py [--out FOLDER]

Two materials answer in a second or two; without ``materials`` more are tried, as ``python -m nuno fold`` does.
"""

import argparse
from pathlib import Path

import nuno

CASE = Path(__file__).parent / "fold-case"

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--out", type=Path, help="a folder for result.json, masks, pictures and the replay")
out = options.parse_args().out

case = nuno.read_fold_case(CASE)
result = case.replay(materials=["towel", "canvas"], device="cpu", progress=False)

print(f"cloth of {result.rectangle.long_m * 100:.1f} x {result.rectangle.short_m * 100:.1f} cm")
for name, score in sorted(result.scores.items(), key=lambda item: -item[1]):
    print(f"{name}: overlap with the video {score:.3f}")
print(f"in {result.seconds['total']:.1f} s, {result.seconds['imagine']:.1f} s of it the replay")

layers = result.layers  # what the camera does not see
under = layers.over(0.25, 0.5)
print(f"{layers.area[1] * 1e4:.0f} cm2 lie under a second layer; over the point (0.25, 0.50) lies", under)
if out:
    result.save(out, names=case.names)

world = result.adopt()  # the world in which the cloth lies folded, to go on from
cloth = world.find("cloth")
world.run(0.1)
print(f"the folded cloth lies {cloth.vertices[:, 2].max() - case.table_height:.3f} m high")

assert max(result.scores.values()) > 0.93 and not result.warnings
# what lies over a point is its mirror image in the fold's line, which slid to u = 0.45 as the hands dragged the cloth
assert len(under) == 1 and abs(under[0][0] - 0.65) < 0.08 and abs(under[0][1] - 0.5) < 0.02
assert cloth.vertices[:, 2].max() - case.table_height < 0.03
