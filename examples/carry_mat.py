"""Talos walks with a soft mat across its arms, held in several ways; which of them keeps it steadiest?

Run: python examples/carry_mat.py [--all] [--mat cloth] [--hold grip] [--out FOLDER]

By itself it tries eight ways for 1.5 s and prints a table; --all tries all 90 for 8 s, in a minute or two; --out
writes the table, CSV and JSON, a plot, and picture strips of the best way and of one in which the mat falls.
"""

import argparse

import numpy as np

import nuno

DISTANCES = (0.27, 0.345)  # [m] between the hands
AHEAD, ASIDE = (0.05, 0.14), (0.0, 0.24)  # [m] from the mat's centre of gravity to the middle between the hands

options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
options.add_argument("--all", action="store_true", help="all 90 ways")
options.add_argument("--mat", choices=("soft", "cloth"), default="soft")
options.add_argument("--hold", choices=("support", "grip"), default="support")
options.add_argument("--out", help="a folder for the files")
asked = options.parse_args()

few = {} if asked.all else dict(arm_distances=DISTANCES, offsets_x=AHEAD, offsets_y=ASIDE, seconds=1.5)
result = nuno.carry_mat("talos", asked.mat, hold=asked.hold, **few)

print("F [mm s] by arm distance, and by the hands' offsets ahead and aside [mm]; x: when the mat fell")
print(result.table())
best = result.trials[result.best]
print(
    f"steadiest: arms {best.arm_distance:.2f} m apart, hands {best.offset_x:+.2f} m ahead and {best.offset_y:+.2f} m "
    f"aside, F = {1000 * best.value:.1f} mm s; the mat fell in {result.failed.sum()} of {len(result.trials)} trials"
)
print(", ".join(f"{name} {seconds:.1f} s" for name, seconds in result.seconds.items()))

if asked.out:
    result.save(asked.out)

if not asked.all and asked.hold == "support":
    beside = np.array([trial.offset_y == max(ASIDE) for trial in result.trials])
    assert (result.failed == beside).all(), "it falls where its centre of gravity is beside both arms, and only there"
