"""CPU seconds in which each module of kernels is compiled to PTX for CUDA, by which functions are kept out of line.

``python benchmarks/cuda_source.py --lines 0 25 60 --json source.json``; no GPU is needed. Functions whose source has at
least so many lines are not inlined; 0 inlines all, as what is launched. ``--mode debug`` optimises nothing; with
``--lines 1`` that is what the tests compile. Each module is compiled in a process and into a cache of its own, as many
at once as there are cores.
"""

import argparse
import gc
import json
import os
import subprocess
import sys
import tempfile
import time

ARCHITECTURE = 90


def compiled(name, lines, mode):
    """Return the CPU seconds for a module, and how large its PTX is [MB]."""
    import warp as wp

    from nuno.kernels.kernel_modules import kernel_modules

    wp.config.log_level = wp.LOG_ERROR
    module = next(each for each in kernel_modules() if each.name == name)
    for each in [found for found in gc.get_objects() if isinstance(found, wp.Function)] if lines else []:
        own = each.func is not None and each.func.__module__.startswith("nuno.")
        if own and each.native_snippet is None and each.adj.source.count("\n") >= lines:
            each.inline_hint = "noinline"
    wp.set_module_options({"block_dim": module.blocks[0], "mode": mode}, module=module.module)
    begin = time.process_time()
    (made,) = wp.compile_aot_module(module.module, arch=ARCHITECTURE, use_ptx=True)
    return time.process_time() - begin, made.stat().st_size / 1e6


def main():
    """Compile all, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lines", type=int, nargs="+", default=[0, 25, 60], help="of functions that are kept apart")
    parser.add_argument("--mode", choices=("release", "debug"), default="release", help="Warp's, of compiling")
    parser.add_argument("--only", nargs="+", help="these modules (default: all that CUDA runs)")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="processes at once")
    parser.add_argument("--json", help="where the figures go")
    parser.add_argument("--one", nargs=2, metavar=("MODULE", "LINES"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(compiled(options.one[0], int(options.one[1]), options.mode)))
        return
    from nuno.kernels.kernel_modules import kernel_modules

    names = [module.name for module in kernel_modules() if "cuda" in module.devices]
    names = [name for name in names if not options.only or name in options.only]
    waiting, running, found = [(name, lines) for name in names for lines in options.lines], {}, {}
    while waiting or running:
        while waiting and len(running) < options.jobs:
            job = waiting.pop(0)
            cache = tempfile.TemporaryDirectory()
            command = [sys.executable, __file__, "--mode", options.mode, "--one", job[0], str(job[1])]
            environment = os.environ | {"WARP_CACHE_PATH": cache.name}
            running[job] = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment), cache
        for job in [each for each, (process, _) in running.items() if process.poll() is not None]:
            process, cache = running.pop(job)
            found[job] = json.loads(process.stdout.read().splitlines()[-1]) if process.returncode == 0 else None
            cache.cleanup()
        time.sleep(0.1)
    print(f"{'CPU s (MB of PTX)':42s}" + "".join(f"{lines or 'inlined':>16}" for lines in options.lines))
    for name in names:
        cells = [found[name, lines] for lines in options.lines]
        print(f"{name:42s}" + "".join(f"{c[0]:9.1f} ({c[1]:4.1f})" if c else f"{'failed':>16}" for c in cells))
    sums = [sum(found[name, lines][0] for name in names if found[name, lines]) for lines in options.lines]
    print(f"{'all':42s}" + "".join(f"{total:9.1f}       " for total in sums))
    if options.json:
        rows = [{"module": name, "lines": lines, "seconds_megabytes": value} for (name, lines), value in found.items()]
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
