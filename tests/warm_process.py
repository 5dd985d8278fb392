"""Programs in processes of their own that have imported Nuno already: forked from one that did so once.

Each starts as ``python FILE`` or ``python -c TEXT`` would, but two to four seconds of a core later. What was imported
before is modules; tests/test_import.py and tests/test_packaging.py look at what programs import by themselves, in
processes that begin with nothing.

Run by itself, this file is the process that is forked.
"""

import json
import os
import runpy
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

WORLD = """
import matplotlib.pyplot, nuno, nuno.robot.simulated_robot
world = nuno.World(device="cpu")
world.add(nuno.box((1, 1, 0.1), name="table"))
kinds = [(nuno.sheet((0.1, 0.1), (2, 2)), nuno.Cloth()), (nuno.soft_box((0.1, 0.1, 0.1), (1, 1, 1)), nuno.Soft()),
         (nuno.sphere(0.1), nuno.Rigid())]
for k, (shape, material) in enumerate(kinds):
    body = world.add(shape)
    body.translate((2.0 * k, 0.0, 1.0))
    world.attach(body, material)
world.run(0.02)
"""
"""What most programs import, and kernels that they load."""


@contextmanager
def warm_programs(environment):
    """Yield a function that runs a program, and returns what ``subprocess.run`` does, its output as text.

    Its arguments are those of Python, ``[file, ...]`` or ``["-c", text]``, the folder in which it runs, and another for
    files of what it writes.
    """
    command = [sys.executable, __file__]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    ) as process:

        def run(arguments, folder, outputs):
            paths = [str(outputs / name) for name in ("stdout.txt", "stderr.txt")]
            process.stdin.write(json.dumps([arguments, str(folder), paths]) + "\n")
            process.stdin.flush()
            code = int(process.stdout.readline())
            said = [Path(path).read_text(encoding="utf-8") for path in paths]
            return subprocess.CompletedProcess(arguments, code, *said)

        yield run
        process.stdin.close()


def _become(arguments, folder, paths):
    """Turn this fork into a program's process."""
    for path, descriptor in zip(paths, (1, 2), strict=True):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), descriptor)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.chdir(folder)
    sys.argv = arguments if arguments[0] != "-c" else ["-c"]
    if arguments[0] != "-c":
        sys.path[0] = str(Path(arguments[0]).resolve().parent)
        runpy.run_path(arguments[0], run_name="__main__")
        return
    sys.path[0] = ""
    main = sys.modules["__main__"] = ModuleType("__main__")
    exec(compile(arguments[1], "<string>", "exec"), vars(main))


def _serve():
    """Fork a process for each line that comes, until none does."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    exec(WORLD, {})
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            answers.close()
            _become(*json.loads(line))
            return
        status = os.waitpid(child, 0)[1]
        answers.write(f"{os.waitstatus_to_exitcode(status)}\n")
        answers.flush()


if __name__ == "__main__":
    _serve()
