"""Where Talos holds a towel, told from its own images, as in `examples/closed_loop.py`, for several cloths and points.

python benchmarks/closed_loop.py [--cloths towel denim interlock] [--points 0,5 1,2 3,3] [--default] [--json FILE]
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

import nuno
from nuno.estimate.hypotheses import HYPOTHESES, Discretisation
from nuno.tasks.pick_towel import TowelPicker
from nuno.tasks.towel_room import TABLE, make_room

QUICK = [Discretisation(cells=15, substeps=12, hypotheses=HYPOTHESES[1::2])]


def pair(text):
    """Return a point of the grid from "1,2"."""
    i, j = text.split(",")
    return int(i), int(j)


def tell(cloth, point, quick):
    """Return what the robot says of a pick, beside the truth, and the seconds that it took."""
    begin = time.perf_counter()
    room = make_room(nuno.Cloth.preset(cloth), device="cpu")
    talos = TowelPicker(room.driver, table=TABLE, device="cpu")
    talos.look_down()
    towel = talos.find_towel()
    talos.pick(talos.point(*point))
    picked = time.perf_counter()
    answer = talos.answer(progress=False, **({"discretisations": QUICK} if quick else {}))
    answered = time.perf_counter()
    talos.believe(answer)
    apart = np.linalg.norm(towel.vertices[:, None] - room.towel.vertices, axis=-1).min(axis=1)
    true = tuple(np.rint(talos.rectangle.fractions(room.held()) * 5).astype(int).tolist())
    return {
        "cloth": cloth, "point": point, "true": true, "told": tuple(answer.pick), "right": tuple(answer.pick) == true,
        "confidence": float(answer.result.confidence), "stereo": float(np.linalg.norm(answer.held - room.held_at())),
        "mean": float(apart.mean()), "largest": float(apart.max()), "seconds": (picked - begin, answered - picked),
    }  # fmt: skip


def main():
    """Print a table, and write it as JSON where that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cloths", nargs="*", default=["towel", "denim", "interlock"])
    parser.add_argument("--points", nargs="*", type=pair, default=[(0, 5), (1, 2), (3, 3)])
    parser.add_argument("--default", action="store_true", help="the default estimate in place of one coarse mesh")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    print("| cloth | held at | told, confidence | held point by stereo | towel in its head, mean, largest | seconds |")
    print("|---|---|---|---|---|---|")
    for cloth in options.cloths:
        for point in options.points:
            row = tell(cloth, point, not options.default)
            rows.append(row)
            print(
                f"| {cloth} | {row['true']} | {row['told']}, {row['confidence']:.2f} | {1000 * row['stereo']:.1f} mm | "
                f"{1000 * row['mean']:.0f}, {1000 * row['largest']:.0f} mm | {row['seconds'][0]:.0f} + "
                f"{row['seconds'][1]:.0f} |", flush=True,
            )  # fmt: skip
    print(f"\n{sum(row['right'] for row in rows)} of {len(rows)} right")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
