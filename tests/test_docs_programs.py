"""The programs that README and docs show run as they stand, page by page, in one namespace."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from nuno.__main__ import main

ROOT = Path(__file__).parents[1]
PAGES = {
    page.stem: page
    for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    if re.search(r"^```python", page.read_text(encoding="utf-8"), re.M)
}
# pages whose programs take some three seconds of a core or more; `test_docs.py` looks for all names of all pages, and
# runs the first program
LONG = {
    "engines", "folds", "following", "learning", "picks", "planning", "robot-dynamics",
    "rigid-bodies", "robot-interface", "scenes", "sensors", "soft-bodies", "sweeps", "tutorial", "viewer", "walking",
    "wire", "worlds",
}  # fmt: skip
# pages whose every call is made by examples, as a test below holds: long tests run the examples, slow ones these pages
OF_EXAMPLES = {
    "carrying": ("carry_mat", "lift_soft_cube"),
    "closed-loop": ("closed_loop",),
    "getting-started": ("drop_on_table",),  # test_docs.py runs it, too
    "garments": ("hold_garment", "follow_in_hand", "pick_outline"),
    "teaching": ("talos_fold",),
}


def blocks(page):
    """Return the blocks of a page, without those before which a comment says that they are not run, and why."""
    text = re.sub(r"^<!-- not run: [^\n]+ -->\n```python\n.*?^```", "", page.read_text("utf-8"), flags=re.M | re.S)
    return re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow if name in OF_EXAMPLES else pytest.mark.long if name in LONG else ())
        for name in sorted(PAGES)
    ],
)
def test_a_page_runs(name, tmp_path, request):
    """All blocks of a page, one after the other, in a process of their own, where examples/ is as in a clone."""
    folder = tmp_path / "here"
    folder.mkdir()
    (folder / "examples").symlink_to(ROOT / "examples")
    source = ""
    for block in blocks(PAGES[name]):
        file = re.match(r"# (\w+\.py)\n", block)
        if file:  # a block that names its file is that file
            (folder / file.group(1)).write_text(block, encoding="utf-8")
        else:
            source += block
    # with -c, as at a prompt: processes that a pool starts do not run it again
    if name in LONG:
        done = request.getfixturevalue("run_warm")(["-c", source], folder, tmp_path)
    else:
        done = subprocess.run(
            [sys.executable, "-c", source], cwd=folder, capture_output=True, text=True, timeout=1800,
            env=os.environ | {"MPLBACKEND": "agg", "BROWSER": "true"},
        )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]


def calls(text):
    """Yield what a program calls: the last part of its name, and the names of its keyword arguments."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func).rpartition(".")[2], frozenset(keyword.arg for keyword in node.keywords)


@pytest.mark.parametrize("name", OF_EXAMPLES)
def test_a_page_calls_what_its_examples_call(name):
    """Each call of a page is one of its examples, with no argument's name that it does not have there."""
    texts = [(ROOT / "examples" / f"{example}.py").read_text(encoding="utf-8") for example in OF_EXAMPLES[name]]
    made = [call for text in texts for call in calls(text)]
    unmade = [
        (called, sorted(words))
        for called, words in calls("".join(blocks(PAGES[name])))
        if not any(called == other and words <= others for other, others in made)
    ]
    assert not unmade


def test_few_blocks_are_not_run():
    """What is left out says why: it needs a machine that is not here, or is an outline of an example, which is run."""
    reasons = [
        reason
        for page in PAGES.values()
        for reason in re.findall(r"^<!-- not run: (.*) -->$", page.read_text("utf-8"), re.M)
    ]
    assert len(reasons) <= 6
    assert all(re.search(r"needs|examples/|first program", reason) for reason in reasons), reasons


COMMANDS = sorted(
    {
        command
        for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
        for block in re.findall(r"^```(?:sh|bash|dockerfile)\n(.*?)^```", page.read_text("utf-8"), re.M | re.S)
        for command in re.findall(r"(?:python -m |RUN |^)(nuno [a-z][^&|\n]*)", block, re.M)
    }
)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_is_known(command, capsys):
    """What a page tells to type is a command, and its --help has the options that are typed."""
    _, name, *words = command.split()
    with pytest.raises(SystemExit, match=r"^0$"):
        main([name, "--help"])
    text = capsys.readouterr().out
    for option in (word.partition("=")[0] for word in words if word.startswith("--")):
        assert option in text, f"{command}: {option}"


@pytest.mark.parametrize(
    "page", ["README.md", "CONTRIBUTING.md", *(f"docs/{p.name}" for p in (ROOT / "docs").glob("*.md"))]
)
def test_scripts_are_there(page):
    """Every program of examples/, benchmarks/ and tests/ that a page names exists."""
    text = (ROOT / page).read_text(encoding="utf-8")
    for name in re.findall(r"\b((?:examples|benchmarks|tests)/[\w/.-]+\.(?:py|html|npz))", text):
        assert (ROOT / name).exists(), name
