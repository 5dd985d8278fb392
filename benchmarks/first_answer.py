"""The first answer of `nuno pick` from an empty kernel cache, and those after it: seconds by the clock and of the CPU.

    python benchmarks/first_answer.py [--device cuda:0] [--levels 1 2 3] [--warm 3] [--json FILE]

Each answer is a command of its own. In an empty cache, without --device as it is called and then warm; with --device
cuda:0 also that device's first answer and its warm ones. ``--levels`` compiles the module of an estimate on CUDA once
more at each of Warp's optimisation levels, all at once beside CUDA's first answer, for CUDA's machine code and for PTX,
and then runs an estimate with each: its seconds, and whether the scores are the same to the bit. Run it on a machine
that does nothing else.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
CASE = ROOT / "examples" / "pick-case"
MODULE = "run_blocks_shared"
AT_MOST = 170.0
"""[s] What takes longer to compile is told as such."""


def environment(cache: str) -> dict[str, str]:
    """Return the environment of a command with a kernel cache of its own, in which Python keeps its bytecode."""
    own = {"WARP_CACHE_PATH": cache, "PYTHONPATH": str(ROOT / "src"), "CUDA_CACHE_DISABLE": "1"}
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"} | own


def answer(name: str, cache: str, device: str) -> dict[str, Any]:
    """Run `nuno pick`, print a line, and return its figures."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "nuno", "pick", str(CASE), "--out", out, "--no-progress", "--device", device]
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        run = subprocess.run(command, env=environment(cache), capture_output=True, text=True)
        wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        result = Path(out) / "result.json"
        stages = json.loads(result.read_text())["seconds"] if result.exists() else {}
    stages = {key: round(value, 2) for key, value in stages.items()}
    print(f"{name:32s} {wall:6.1f} s by the clock, {cpu:6.1f} of the CPU; {stages}", flush=True)
    for line in (run.stdout + run.stderr).splitlines():
        print(f"    {line}", flush=True)
    return {"name": name, "wall": wall, "cpu": cpu, "stages": stages, "rc": run.returncode}


def compile_level(level: int, ptx: bool, cache: str) -> dict[str, Any]:
    """Compile the module at a level in a process of its own, print a line, and return its figures."""
    name = f"level {level} to {'PTX' if ptx else 'machine code'}"
    command = [sys.executable, __file__, "--one", "compile", str(level), str(int(ptx))]
    start = time.perf_counter()
    try:
        run = subprocess.run(command, env=environment(cache), capture_output=True, text=True, timeout=AT_MOST)
        found = json.loads(run.stdout.splitlines()[-1]) if run.returncode == 0 else {"error": run.stderr[-400:]}
    except subprocess.TimeoutExpired:
        found = {"error": f"not done after {AT_MOST} s"}
    print(f"{name:32s} {time.perf_counter() - start:6.1f} s by the clock; {found}", flush=True)
    return {"name": name} | found


def run_level(level: int, cache: str, device: str) -> dict[str, Any]:
    """Run estimates with a module that was compiled at a level, print a line, and return its figures."""
    command = [sys.executable, __file__, "--one", "run", str(level), device]
    run = subprocess.run(command, env=environment(cache), capture_output=True, text=True)
    found = json.loads(run.stdout.splitlines()[-1]) if run.returncode == 0 else {"error": run.stderr[-400:]}
    print(f"{f'estimates at level {level}':32s} {found}", flush=True)
    return {"name": f"estimates at level {level}"} | found


def one(kind: str, level: int, what: str) -> dict[str, Any]:
    """Compile the module or run estimates with it, in this process."""
    import warp as wp

    from nuno.kernels.kernel_modules import kernel_modules
    from nuno.kernels.struct_references import pass_structs_by_reference

    wp.config.log_level = wp.LOG_ERROR
    pass_structs_by_reference()
    module = next(each for each in kernel_modules() if each.name.endswith("." + MODULE))
    wp.set_module_options({"block_dim": module.blocks[0], "optimization_level": level}, module=module.module)
    if kind == "compile":
        begin = time.process_time()
        (made,) = wp.compile_aot_module(module.module, arch=90, use_ptx=what == "1")
        return {"cpu": round(time.process_time() - begin, 1), "bytes": made.stat().st_size}
    from nuno.estimate.case import read_case

    wp.config.cuda_output = "cubin"
    case, seconds = read_case(CASE), []
    for _ in range(4):
        start = time.perf_counter()
        result = case.estimate(device=what, progress=False)
        seconds.append(round(time.perf_counter() - start, 3))
    digest = hashlib.sha1(result.scores.tobytes() + result.eq1.tobytes()).hexdigest()[:10]
    return {"seconds": seconds, "stages": result.seconds, "scores": digest, "best": str(result.best)}


def main() -> None:
    """Run all, and print as it comes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu", help="cpu (default), cuda:0 ...")
    parser.add_argument("--levels", type=int, nargs="*", default=[], help="of Warp's optimisation, 1 to 3")
    parser.add_argument("--warm", type=int, default=3, help="answers after the first")
    parser.add_argument("--json", help="where the figures go")
    parser.add_argument("--one", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(one(options.one[0], int(options.one[1]), options.one[2])))
        return
    print(f"{len(os.sched_getaffinity(0))} CPUs, load {os.getloadavg()[0]:.1f}", flush=True)
    found: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        cpu, cuda = f"{folder}/cpu", f"{folder}/cuda"
        device = "auto" if options.device != "cpu" else "cpu"
        for k in range(1 + options.warm):
            found.append(answer("first answer, no --device" if k == 0 else "warm, no --device", cpu, device))
        if options.device != "cpu":
            compiling = [
                threading.Thread(
                    target=lambda level=level, ptx=ptx: found.append(
                        compile_level(level, ptx, f"{folder}/level{level}-{int(ptx)}")
                    )
                )
                for level in options.levels
                for ptx in (False, True)
            ]
            for thread in compiling:
                thread.start()
            found.append(answer(f"first answer, {options.device}", cuda, options.device))
            for thread in compiling:
                thread.join()
            for _ in range(options.warm):
                found.append(answer(f"warm, {options.device}", cuda, options.device))
            for level in options.levels:
                if any(each["name"] == f"level {level} to machine code" and "bytes" in each for each in found):
                    found.append(run_level(level, f"{folder}/level{level}-0", options.device))
    if options.json:
        Path(options.json).write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
