"""What README and docs show is Python, uses names that there are, and the first program that they show runs."""

import ast
import builtins
import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import nuno

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCKS = {
    f"{page.stem}-{number}": text
    for page in PAGES
    for number, text in enumerate(re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S))
}
# what the docs call things of these classes, on every page; a robot is its model on some and its driver on others
CALLED = {
    "world": (nuno.World,),
    "futures": (nuno.World,),
    "towel": (nuno.Body,),
    "table": (nuno.Body,),
    "grip": (nuno.Grip,),
    "recording": (nuno.Recording,),
    "robot": (nuno.SimulatedRobot, nuno.Humanoid, nuno.WireRobot),
    "viewer": (nuno.Viewer,),
    "path": (nuno.Path,),
}

NEVER_RAISE = {"boundary_faces", "box_tetrahedra"}


def test_there_are_blocks():
    """The pages were found, and programs in them."""
    assert len(BLOCKS) > 20


@pytest.mark.parametrize("name", BLOCKS)
def test_names_are_there(name):
    """Every block compiles; ``nuno.X`` is public, and what is asked of a world, body or robot is a member."""
    for node in ast.walk(ast.parse(BLOCKS[name])):
        if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Name):
            continue
        if node.value.id == "nuno":
            assert node.attr in nuno.__all__, f"nuno.{node.attr}"
        elif node.value.id in CALLED:
            members = set().union(*(members_of(owner) for owner in CALLED[node.value.id]))
            assert node.attr in members, f"{node.value.id}.{node.attr}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_is_called_is_known(page):
    """No block calls a function or class that the page has neither imported nor defined before."""
    known = set(dir(builtins))
    for name in (name for name in BLOCKS if name.rpartition("-")[0] == page.stem):
        nodes = list(ast.walk(ast.parse(BLOCKS[name])))
        for node in nodes:
            if isinstance(node, ast.Import | ast.ImportFrom):
                known |= {alias.asname or alias.name for alias in node.names}
            elif isinstance(node, ast.FunctionDef | ast.ClassDef):
                known.add(node.name)
        called = {node.func.id for node in nodes if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
        assert called <= known, f"{name}: {called - known}"


def members_of(owner):
    """Return what a class has, with the attributes that its modules set of an object."""
    found = set(dir(owner))
    for part in owner.__mro__[:-1]:
        for node in ast.walk(ast.parse(Path(sys.modules[part.__module__].__file__).read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
                found.add(node.attr)
    return found | set(getattr(owner, "__dataclass_fields__", ()))


def test_links_lead_somewhere():
    """Every relative link of a page is a file."""
    for page in PAGES:
        for link in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_every_public_name_is_on_an_api_page():
    """Each name of ``nuno.__all__`` is documented in docs/api, once, and whatever is documented there exists."""
    pages = "\n".join(page.read_text(encoding="utf-8") for page in sorted((ROOT / "docs" / "api").glob("*.md")))
    documented = re.findall(r"^\.\. auto(?:class|function|exception|data):: ([\w.]+)$", pages, re.M)
    assert len(documented) == len(set(documented))
    public = {name for name in nuno.__all__ if not is_error(getattr(nuno, name))}
    assert public - {name.removeprefix("nuno.") for name in documented} == set()
    assert ".. automodule:: nuno.errors" in pages  # with all its members
    for name in documented:
        owner, _, last = name.rpartition(".")
        assert hasattr(importlib.import_module(owner), last), name


def test_every_public_function_says_what_it_takes():
    """Each public name has a docstring; a function's has all its arguments, and the errors where it raises some."""
    for name in nuno.__all__:
        found = getattr(nuno, name)
        text = inspect.getdoc(found)
        assert text, name
        if inspect.isfunction(found):
            for argument in inspect.signature(found).parameters:
                assert re.search(rf"^ +{argument}: ", text, re.M), f"{name}: {argument}"
            assert "Raises:" in text or name in NEVER_RAISE, name


def is_error(found):
    """Return whether a public name is an error's class."""
    return isinstance(found, type) and issubclass(found, Exception)


@pytest.mark.parametrize("page", sorted((ROOT / "docs" / "reports").glob("[!i]*.md")), ids=lambda page: page.stem)
def test_measurements_name_their_command_and_data(page):
    """Each section of a report that has a table says what makes it and which data that needs; its scripts are there."""
    text = page.read_text(encoding="utf-8")
    for section in re.split(r"^(?=#)", text, flags=re.M)[1:]:
        if re.search(r"^\|", section, re.M):
            assert re.search(r"^Made by: .*\nData: ", section, re.M | re.S), section.splitlines()[0]
    for script in re.findall(r"benchmarks/\w+\.py", text):
        assert (ROOT / script).exists(), script


def test_every_example_is_in_the_gallery():
    """docs/examples.md has a card and a section for each program in examples/, and no other."""
    page = (ROOT / "docs" / "examples.md").read_text(encoding="utf-8")
    programs = sorted(p.stem for p in (ROOT / "examples").glob("*.py"))
    cards = re.search(r"```{example-cards}\n(.*?)```", page, re.S).group(1)
    assert sorted(cards.split()) == programs
    assert sorted(re.findall(r"^```{example} (\w+)$", page, re.M)) == programs
    assert sorted(re.findall(r"^\((\w+)\)=$", page, re.M)) == programs  # where the cards lead
    notebooks = sorted(p.stem for p in (ROOT / "examples" / "notebooks").glob("*.ipynb"))
    assert sorted(re.findall(r"^```{notebook} (\w+)$", page, re.M)) == notebooks


def test_the_first_program_runs(tmp_path):
    """That of docs/getting-started.md, as it is, in a process of its own, which prints no line of Warp's."""
    (tmp_path / "first.py").write_text(BLOCKS["getting-started-0"])
    done = subprocess.run([sys.executable, "first.py"], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "(425, 3)\n"
