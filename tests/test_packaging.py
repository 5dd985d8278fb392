"""What is published, and what a program without the optional packages gets."""

import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

import nuno

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
# Import names of what extras bring, none of which `pip install .` has.
OPTIONAL = (
    "pinocchio", "coal", "example_robot_data", "pink", "daqp", "meshcat", "tornado", "websockets", "cma", "distributed",
    "pytetwild", "IPython", "gymnasium", "mujoco", "pxr",
)  # fmt: skip
BLOCKER = """
import importlib.metadata, sys

class Without:
    def __init__(self, finder):
        self.finder = finder

    def find_spec(self, name, *others):
        return None if name.split(".")[0] in sys.argv[1].split(",") else self.finder.find_spec(name, *others)

real = importlib.metadata.distribution
def distribution(name):
    if name.replace("-", "_") in sys.argv[1].split(","):
        raise importlib.metadata.PackageNotFoundError(name)
    return real(name)

importlib.metadata.distribution = distribution
sys.meta_path[:] = [Without(finder) for finder in sys.meta_path]
import nuno
"""

END = "that is all of it"


def without(code, packages=OPTIONAL):
    """Run ``code`` in a process that has none of some packages, and return what it prints."""
    command = [sys.executable, "-c", BLOCKER + code, ",".join(packages)]
    return subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout


def test_getting_started_lists_every_extra():
    """The table of extras has all of pyproject.toml but those for developers, and no other."""
    page = (ROOT / "docs" / "getting-started.md").read_text(encoding="utf-8")
    table = page.partition("| extra | for | brings |")[2].partition("\n\n")[0]
    assert set(re.findall(r"^\| `([\w-]+)` \|", table, re.MULTILINE)) == set(EXTRAS) - {"test", "dev", "docs"}


def test_every_module_loads_or_names_the_extra():
    """Without the extras no module raises but MissingPackageError, with an extra that there is."""
    code = """
import importlib, pkgutil
for module in pkgutil.walk_packages(nuno.__path__, "nuno."):
    if module.name != "nuno.__main__":
        try:
            importlib.import_module(module.name)
        except nuno.MissingPackageError as error:
            print(module.name, error.extra)
"""
    missed = dict(line.split() for line in without(code).splitlines())
    assert set(missed.values()) <= set(EXTRAS)
    assert {name.split(".")[1] for name in missed} <= {"robot", "viewer", "tasks", "envs"}, "all else needs none"
    assert missed["nuno.robot.humanoid"] == "robot" and missed["nuno.viewer"] == "viewer"


USES = [
    ("nuno.Humanoid", "pin", "robot"),
    ("nuno.plan_walk", "pin", "robot"),
    ("nuno.TowelPicker", "pin", "robot"),
    ("nuno.WireRobot", "pin", "robot"),
    ("nuno.Viewer", "tornado", "viewer"),
    ("nuno.Viewer(nuno.World())", "meshcat", "viewer"),
    ("nuno.Humanoid('talos')", "example-robot-data", "robot"),
    ("nuno.World(engine='mujoco')", "mujoco 4", "mujoco"),
    ("nuno.minimise(lambda world, params: None, {'x': (0, 1)}, value='v')", "cma", "search"),
]
MISSING = tuple(code for code, *_ in USES)


@cache
def refused(codes, *packages):
    """Return what is said of each use of packages that are not there, all in one process."""
    attempts = (
        f"try:\n    {code}\nexcept nuno.MissingPackageError as error:\n    print(error.package, error.extra, error)\n"
        f"print({END!r})\n"
        for code in codes
    )
    return without("".join(attempts), packages).split(f"{END}\n")


@pytest.mark.parametrize(("code", "package", "extra"), USES)
def test_a_missing_package_is_named(code, package, extra):
    """What is used without its extra names the package as pip calls it, and the command that works in a clone."""
    single = package in ("meshcat", "example-robot-data")  # the others are met before these
    out = refused((code,), package.replace("-", "_"))[0] if single else refused(MISSING, *OPTIONAL)[MISSING.index(code)]
    assert out.startswith(f"{package} {extra} ")
    assert f"in a clone of Nuno: pip install -c constraints.txt '.[{extra}]'" in out


@pytest.mark.long
def test_cloth_and_cases_need_no_extra():
    """A world with cloth, a picture of it and the bundled cases work with what ``pip install .`` brings."""
    code = """
world = nuno.World(device="cpu")
world.add(nuno.box((1, 1, 0.02), name="table"))
towel = world.add(nuno.sheet((0.3, 0.2), cells=(6, 4), position=(0, 0, 0.05)))
world.attach(towel)
world.run(0.05)
camera = nuno.Camera(32, 24, 30.0, 30.0, 15.5, 11.5, [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1], [0, 0, 0, 1]])
print(nuno.take_picture(world, camera).mask(towel).sum() > 0)
print(nuno.read_case("examples/pick-case") is not None, nuno.read_fold_case("examples/fold-case") is not None)
"""
    assert without(code).split()[-3:] == ["True"] * 3


def test_all_has_every_extra_for_users():
    """``nuno-sim[all]`` brings what each extra brings, but for those of developers."""
    (everything,) = EXTRAS["all"]
    named = set(re.fullmatch(r"nuno-sim\[(.*)\]", everything)[1].split(","))
    assert named == set(EXTRAS) - {"all", "test", "dev", "docs"}


def test_every_dependency_has_one_version_in_the_constraints():
    """What pyproject.toml names can be installed again as it was."""
    pinned = {re.split(r"==", line)[0] for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line}
    named = [*PROJECT["dependencies"], *(each for extra in EXTRAS.values() for each in extra)]
    names = {re.match(r"[\w.-]+", each)[0].lower().replace("_", "-") for each in named} - {"nuno-sim"}
    assert names <= pinned


def test_one_version():
    """Package, metadata and citation have the same version, which the command prints."""
    assert nuno.__version__ == PROJECT["version"]
    assert f"\nversion: {nuno.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    said = subprocess.run([sys.executable, "-m", "nuno", "--version"], capture_output=True, text=True, check=True)
    assert said.stdout == f"nuno {nuno.__version__}\n"


def test_hints_work_from_a_clone():
    """Nobody is told to install from an index on which Nuno is not."""
    texts = [*ROOT.glob("docs/*.md"), *(ROOT / "src").rglob("*.py"), ROOT / "README.md", *ROOT.glob("examples/*.py")]
    assert not [path.name for path in texts if re.search(r"pip install\s+'?nuno", path.read_text(encoding="utf-8"))]


@pytest.mark.long
def test_the_image_compiles_with_options_that_there_are():
    """What the Dockerfile runs of Nuno is understood by the command, for extras that there are."""
    text = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    arguments = dict(re.findall(r"^ARG (\w+)=(\S+)$", text, re.M))
    assert set(arguments["EXTRAS"].split(",")) <= set(EXTRAS)
    (command,) = re.findall(r"^RUN nuno (compile.*?) &&", text, re.M)
    words = command.replace("${ARCH}", arguments["ARCH"]).split()
    done = subprocess.run(
        [sys.executable, "-m", "nuno", *words, "--only", "no.such.module"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2 and "no.such.module" in done.stderr, "all but the module's name is right"


def test_the_workflow_calls_ci_run():
    """What holds on GitHub is what `.ci/run` holds anywhere, within its time."""
    text = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    assert "- run: .ci/run" in text
    assert "twine check --strict" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
