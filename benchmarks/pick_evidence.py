"""All that the confidence of a pick is a function of, of generated cases: ``python benchmarks/pick_evidence.py DIR``.

Processes make cases with Nuno's own engine, by seeds, and estimate them through all stages: half of the rounds ordinary
and far hands through noisy masks (``generated_cases.py``), half what leaves the ordinary through images
(``varied_cases.py``). Every case is a line of evidence.jsonl (what is told, the truth, the answer, warnings, seconds)
and a few arrays of evidence-*.npz (every future's scores at every pose, both masks). ``doubt_fit.py`` reads them.

    python benchmarks/pick_evidence.py out --workers 6 cuda:0 --workers 10 cpu --limit 480 [--stop]
"""

from __future__ import annotations

import argparse
import gc
import json
import logging
import multiprocessing
import os
import tempfile
import time
import traceback
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from pick_stages import NAMES, stages_named

WHAT_IFS = (("focal", 0.9), ("focal", 0.95), ("focal", 1.05), ("focal", 1.1), ("table", -0.03), ("table", 0.03))
"""Camera and table as they may be instead: a factor of the focal length, or [m] added to the table's height."""
LOOKED_AT = 6  # candidates of a what-if
ASKED = ("ordinary", "sideways", "focal_off", "table_off", "tilt_off", "hand_off")
"""Kinds of which what-ifs are asked."""
CHUNK = 14_000_000  # [bytes] of an npz file


class Kept:
    """Keeps the trials of an estimate, which its result does not tell."""

    def __init__(self) -> None:
        from nuno.estimate import pick

        self.trials: Any = None
        self._original = pick.try_picks
        pick.try_picks = self._try

    def _try(self, *arguments: Any) -> Any:
        self.trials = self._original(*arguments)
        return self.trials


def rounds(
    number: int, seed: int, device: str, only: tuple[str, ...] = ()
) -> Iterator[tuple[str, str, dict[str, Any], list[int], dict[str, Any]]]:
    """One round's cases: name, kind, arguments of `nuno.estimate_pick`, the true candidate, what else is true.

    With ``only`` it is one scene with these departures.
    """
    from generated_cases import SIDEWAYS, generate
    from varied_cases import ONE_SCENE, OWN_SCENE, make_cases

    if number % 2 == 0 and not only:
        far = number % 4 == 2
        for k, case in enumerate(generate(1, 10, seed + number, device, (0.1, 0.35) if far else SIDEWAYS)):
            arguments = dict(
                before=None, after=None, camera=case.camera, table_height=case.table.height, hand=case.hand,
                table_half_extents=case.table.half_extents, table_centre=case.table.centre,
                before_mask=case.mask_before, after_mask=case.mask_after,
            )  # fmt: skip
            kind = "masks_far" if far else "masks"
            yield f"{seed + number}-{k}-{kind}", kind, arguments, list(case.true_ij), {"material": case.material}
        return
    kinds = ONE_SCENE if number % 4 == 1 else (*ONE_SCENE, OWN_SCENE[number // 4 % len(OWN_SCENE)])
    made = make_cases(1, seed + number, "nuno", device, only or kinds)
    for n, (name, told, truth, before, after) in enumerate(made):
        arguments = told_of(told, before, after)
        yield f"{name}-{n}" if only else name, truth["kind"], arguments, truth["true_ij"], truth


def from_folder(folder: Path, number: int) -> Iterator[tuple[str, str, dict[str, Any], list[int], dict[str, Any]]]:
    """The same of one of the case folders that ``varied_cases.py`` wrote; nothing behind the last one."""
    paths = sorted(path.parent for path in folder.glob("*/truth.json"))
    for path in paths[number : number + 1]:
        told, truth = (json.loads((path / name).read_text()) for name in ("input.json", "truth.json"))
        images = (cv2.imread(str(path / told[f"image_{name}"])) for name in ("before", "after"))
        before, after = (np.ascontiguousarray(image[..., ::-1]) for image in images)
        yield path.name, truth["kind"], told_of(told, before, after), truth["true_ij"], truth


def told_of(told: dict[str, Any], before: np.ndarray, after: np.ndarray) -> dict[str, Any]:
    """Arguments of `nuno.estimate_pick` by an input.json and two images."""
    return dict(
        before=before, after=after, camera=told["camera"], table_height=told["table_height_m"],
        hand=told["hand_position_m"], table_half_extents=told["table_half_extents_xy_m"],
        table_centre=told["table_centre_xy_m"], table_thickness=told["table_thickness_m"],
    )  # fmt: skip


def judged(
    kept: Kept, arguments: dict[str, Any], device: str, sure: float, ask: bool
) -> tuple[dict[str, Any], dict[str, Any]]:
    """An estimate's line and arrays."""
    from nuno import estimate_pick

    kept.trials = None
    gc.collect()  # what the case before left takes a gigabyte before Python looks for it
    started = time.perf_counter()
    result = estimate_pick(device=device, progress=False, sure=sure, **arguments)
    seconds = time.perf_counter() - started
    trials = kept.trials
    line = {
        "pick": list(result.best), "order": result.order.tolist(), "confidence": result.confidence,
        "trusted": result.trusted, "warnings": result.warnings, "seen_warnings": list(trials.seen.warnings),
        "odd": list(trials.warnings), "rectangle_warnings": list(result.rectangle.warnings),
        "rectangle": result.rectangle.corners.tolist(), "residual_px": result.rectangle.residual,
        "by_outline": result.by_position, "hand": np.asarray(arguments["hand"]).tolist(),
        "camera": result.camera.to_dict() if hasattr(result.camera, "to_dict") else described(result.camera),
        "table_height": arguments["table_height"], "seconds": seconds, "stages": result.seconds,
        "scores": result.scores.tolist(),
        "mistakes": [[h.mistake for h in batch.discretisation.hypotheses] for batch in trials.batches],
        "up_first": [[h.up_first for h in batch.discretisation.hypotheses] for batch in trials.batches],
        "self_contact": [batch.discretisation.self_contact for batch in trials.batches],
    }  # fmt: skip
    arrays = {f"stage{k}": packed(c) for k, c in enumerate(trials.comparisons)}
    for k, of_stage in enumerate(getattr(trials, "reflected", ())):
        arrays |= {f"mirror{k}-{n}": packed(c) for n, c in enumerate(of_stage)}
    for name, mask in (("before", result.mask_before), ("after", result.mask_after)):
        arrays[f"mask_{name}"] = np.packbits(mask)
    if ask and not result.by_position:
        line["what_ifs"], asked = what_ifs(kept, result, arguments, device)
        arrays |= asked
    return line, arrays


def described(camera: Any) -> dict[str, Any]:
    """A camera as in an input.json."""
    return {
        "width": camera.width, "height": camera.height, "fx": camera.fx, "fy": camera.fy, "cx": camera.cx,
        "cy": camera.cy, "camera_to_world": np.asarray(camera.camera_to_world).tolist(),
    }  # fmt: skip


def packed(comparison: Any) -> dict[str, np.ndarray]:
    """A comparison's arrays, short."""
    found = {"candidates": comparison.candidates.astype(np.int16), "finite": comparison.finite}
    for name in ("chamfer", "iou", "pattern", "eq1"):
        value = getattr(comparison, name)
        if value is not None and name != "eq1":
            found[name] = value.astype(np.float16)
    if comparison.correction is not None:
        found["correction"] = comparison.correction.astype(np.float32)
    if getattr(comparison, "weights", None) is not None:
        found["weights"] = comparison.weights
    found["turns"], found["log_priors"] = comparison.turns, comparison.log_priors
    return found


def what_ifs(
    kept: Kept, result: Any, arguments: dict[str, Any], device: str
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The best candidates under three guesses, as is told and where camera or table are otherwise."""
    from nuno import NunoError, estimate_pick
    from nuno.camera.camera import Camera
    from nuno.estimate.hypotheses import Discretisation, Hypothesis

    firm = dict(stretch_stiffness=1000.0, shear_stiffness=40.0)
    guesses = (
        Hypothesis(1e-4, 0.3, **firm), Hypothesis(8e-4, 0.5, **firm),
        Hypothesis(1e-4, 0.4, stretch_stiffness=150.0, shear_stiffness=15.0),
    )  # fmt: skip
    best = result.order[:LOOKED_AT]
    lines, arrays = [], {}
    told = arguments["camera"]
    camera = told if isinstance(told, Camera) else Camera.from_dict(told)
    for what, value in (("told", 0.0), *WHAT_IFS):
        changed = dict(arguments)
        if what == "focal":
            changed["camera"] = replace(camera, fx=camera.fx * value, fy=camera.fy * value)
        elif what == "table":
            changed["table_height"] = arguments["table_height"] + value
        changed |= {"before_mask": result.mask_before, "after_mask": result.mask_after}
        line: dict[str, Any] = {"what": what, "value": value, "candidates": best.tolist()}
        try:
            other = estimate_pick(
                device=device, progress=False, sure=1.0, candidates=result.fractions[best], shape="rectangle",
                discretisations=(Discretisation(20, 14, guesses),), **changed,
            )  # fmt: skip
            line |= {
                "corners": other.rectangle.corners.tolist(), "residual_px": other.rectangle.residual,
                "scores": other.scores.tolist(), "warnings": list(other.rectangle.warnings),
            }  # fmt: skip
            arrays[f"what{len(lines)}"] = packed(kept.trials.comparisons[0])
        except NunoError as error:
            line["error"] = str(error)
        lines.append(line)
    return lines, arrays


def pin(number: int) -> None:
    """Keep to one core, as the other processes have theirs."""
    cores = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {cores[number % len(cores)]})


def work(
    number: int,
    device: str,
    jobs: Any,
    ready: Any,
    folder: Path,
    options: argparse.Namespace,
    started: float,
    first: bool,
) -> None:
    """Judge rounds until there are no more or the time is up; the first process of a device compiles on all cores."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    if not (first or options.share):
        pin(number)
    import warp as wp

    from nuno import NunoError
    from nuno.estimate.hypotheses import DISCRETISATIONS
    from nuno.estimate.ranking import SURE

    wp.config.log_level = wp.LOG_ERROR
    logging.disable(logging.WARNING)
    cv2.setNumThreads(1)
    kept, deadline = Kept(), started + options.limit
    if options.no_reflections:
        from nuno.estimate import pick_trials

        pick_trials.mirrored = lambda *_: None
    sure, stages = SURE if options.stop else 1.0, stages_named(options.stages)
    if options.settle is not None:
        stages = tuple(replace(stage, settle_seconds=options.settle) for stage in stages or DISCRETISATIONS)
    with (folder / f"{number}.jsonl").open("w") as lines:
        while time.time() < deadline and not jobs.empty():
            try:
                job = jobs.get(timeout=1.0)
                made = (
                    rounds(job, options.seed, device, tuple(options.kinds))
                    if options.cases is None
                    else from_folder(options.cases, job)
                )
                for name, kind, arguments, true, truth in made:
                    if stages is not None:
                        arguments["discretisations"] = stages
                    row = {"case": name, "round": job, "kind": kind, "device": device, "true": true}
                    row |= {"material": truth["material"], "at": time.time() - started}
                    try:
                        line, kept_arrays = judged(kept, arguments, device, sure, options.what_ifs and kind in ASKED)
                        row |= line
                        write_arrays(folder / f"{name}.zip", name, kept_arrays)
                    except NunoError as error:  # no answer is a wrong answer
                        row["error"] = str(error)
                    lines.write(json.dumps(row) + "\n")
                    lines.flush()
                    if first and not ready.is_set():
                        if not options.share:
                            pin(number)
                        ready.set()
                    if time.time() > deadline:
                        break
            except Exception:
                traceback.print_exc()


def write_arrays(path: Path, name: str, arrays: dict[str, Any]) -> None:
    """A case's arrays, as entries of an npz file."""
    with zipfile.ZipFile(path.with_suffix(".part"), "w", zipfile.ZIP_DEFLATED) as file:
        for part, value in arrays.items():
            for key, array in (value if isinstance(value, dict) else {"": value}).items():
                with file.open(".".join(filter(None, (name, part, key, "npy"))), "w") as entry:
                    np.lib.format.write_array(entry, np.ascontiguousarray(array), allow_pickle=False)
    path.with_suffix(".part").rename(path)


def gather(parts: Path, folder: Path) -> int:
    """Put the workers' files together, npz files no larger than `CHUNK`; returns the number of cases."""
    rows = [line for file in sorted(parts.glob("*.jsonl")) for line in file.read_text().splitlines()]
    (folder / "evidence.jsonl").write_text("".join(row + "\n" for row in rows))
    out, size, count = None, CHUNK, 0
    for file in sorted(parts.glob("*.zip")):
        with zipfile.ZipFile(file) as source:
            for entry in source.infolist():
                if size + entry.compress_size > CHUNK:
                    if out is not None:
                        out.close()
                    out = zipfile.ZipFile(folder / f"evidence-{count}.npz", "w", zipfile.ZIP_DEFLATED)
                    size, count = 0, count + 1
                out.writestr(entry.filename, source.read(entry))
                size += entry.compress_size + 200
    if out is not None:
        out.close()
    return len(rows)


def main() -> None:
    """Dump evidence."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--workers", nargs=2, action="append", metavar=("COUNT", "DEVICE"), help="default: 1 cpu")
    parser.add_argument("--rounds", type=int, default=400, help="each makes 10 to 16 cases")
    parser.add_argument("--first", type=int, default=0, help="number of the first round")
    parser.add_argument("--seed", type=int, default=50_000)
    parser.add_argument("--limit", type=float, default=420.0, help="[s] after which no case is begun")
    parser.add_argument("--kinds", nargs="+", default=[], help="of varied_cases.py: each round is a scene with these")
    parser.add_argument("--cases", type=Path, help="a folder of case folders to take in place of generated ones")
    parser.add_argument("--share", action="store_true", help="let processes take all cores, for seconds by the clock")
    parser.add_argument("--settle", type=float, help="[s] at most that cloths may take to come to rest")
    parser.add_argument("--stages", choices=NAMES, default="now", help="of pick_stages.py")
    parser.add_argument("--no-reflections", action="store_true", help="take no future for one of another candidate")
    parser.add_argument("--what-ifs", action="store_true", help="ask also whether camera and table are as told")
    parser.add_argument("--stop", action="store_true", help="end the stages as users' estimates do, for true seconds")
    options = parser.parse_args()
    if options.cases is not None and not any(options.cases.glob("*/truth.json")):
        parser.error(f"no case folder with a truth.json in {options.cases}")
    started = time.time()
    parts = Path(tempfile.mkdtemp())
    options.folder.mkdir(parents=True, exist_ok=True)
    context = multiprocessing.get_context("spawn")
    jobs, processes = context.Queue(), []
    wanted = options.workers or [("1", "cpu")]
    events = {device: context.Event() for _, device in wanted}  # kept to the end, for children open them late
    for k in range(options.first, options.first + options.rounds):
        jobs.put(k)
    time.sleep(0.5)  # until the queue is no longer empty to others

    def begin(device: str, ready: Any, first: bool) -> None:
        arguments = (len(processes), device, jobs, ready, parts, options, started, first)
        processes.append(context.Process(target=work, args=arguments, daemon=True))
        processes[-1].start()

    waiting = {}
    for count, device in wanted:  # one of each first: the others take from the cache what it compiles
        waiting[device] = (events[device], int(count) - 1)
        begin(device, waiting[device][0], True)
    while waiting and time.time() < started + 0.8 * options.limit:
        for device, (ready, count) in list(waiting.items()):
            if ready.wait(0.2):
                print(f"first case on {device} after {time.time() - started:.0f} s", flush=True)
                for _ in range(count):
                    begin(device, ready, False)
                del waiting[device]
    for process in processes:
        process.join(max(1.0, started + options.limit + 45.0 - time.time()))
        if process.is_alive():
            process.terminate()
    jobs.close()
    jobs.cancel_join_thread()
    count = gather(parts, options.folder)
    print(f"{count} cases in {time.time() - started:.0f} s with {len(processes)} processes", flush=True)


if __name__ == "__main__":
    main()
