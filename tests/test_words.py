"""The field's words: none of those that this project once used instead names a thing, but in a plain sense."""

import re
from pathlib import Path

import pytest

from package_sources import PACKAGE, docstrings, identifiers

FOLDERS = (
    "contact", "tables", "estimate", "camera", "search", "tasks", "mesh", "shapes", "files", "kernels", "joints",
    "numbers", "state", "constraints", "plans", "solvers", "topology", "rigid", "coupled", "bodies", "world",
    "envs", "engines", "scenes", "tracking", "robot", "dynamics",
)  # fmt: skip
"""Where nothing is left; `tests/test_imports.py` looks for the first of the words in all folders."""

# Word: what it is called now.
REPLACED = {
    "roll": "residency", "gate": "grid barrier", "helping": "spare blocks", "listed": "neighbour list",
    "picked": "inner list", "touched": "active", "window": "region, subarray", "windows": "regions",
    "wide": "SIMD", "fine": "double precision", "rough": "float", "times": "*", "over": "/", "root": "sqrt",
    "most": "maximum", "least": "minimum", "fill": "full_like", "spread": "broadcast", "largest": "lane_max",
    "known": "mask", "told": "measured, reported", "beside": "relative_to", "press": "resolve",
    "pulls": "attachments", "layers": "self-contact", "idle": "position correction", "sharp": "feature",
    "gone": "motion bound",
    "rod": "capsule", "ball": "sphere", "drum": "cylinder", "rounds": "colours, iterations", "cast": "scene objects",
    "yarn": "grid line", "yarns": "grid lines", "star": "element cluster", "stars": "element clusters",
    "party": "crew", "parties": "crews",
    "convoy": "batch of paths", "team": "block group", "teams": "block groups",
    "verdict": "result", "lessened": "reduced", "heed": "lookahead", "ghost": "copy", "awake": "active",
    "soonest": "motion bound", "haste": "motion bound", "hasten": "change_velocity", "swift": "fast",
    "crumpled": "wrinkled", "actor": "scene object", "actors": "scene objects",
    "wardrobe": "styles", "onlooker": "watcher",
    "led": "kinematic", "meet": "overlap", "turn": "rank, rotation", "turns": "slices, rotations",
}  # fmt: skip

# Of those the ones that have no plain sense, which documentation may not begin with either.
NOUNS = (
    "actors?", "awake", "convoys?", "crumpled", "drum", "gate", "ghosts?", "haste", "heed", "helping", "idle",
    "lessened", "onlooker", "part(y|ies)", "pulls", "rod", "rounds", "soonest", "stars?", "swift", "teams?", "verdict",
    "wardrobe", "yarns?",
)  # fmt: skip

# Words with a plain sense that named something else in kernels: where, and what it is called now.
IN_KERNELS = {"near": "shape list, floats, mean", "those": "crew"}
KERNELS = ("state", "constraints", "plans", "numbers")

# Where a viewer's page picks bodies with the mouse, as the field says.
IN_VIEWER = {word: now for word, now in REPLACED.items() if word != "picked"}

# What an identifier may be in spite of its word, and why.
ALLOWED = {
    r"(frame_|key_|_frame_|_grip_|_same_|_with_equal_)?times|_times": "points in time [s]",
    r"(\w*_)?turn(s|_\w+)?|TURNS?|checked_turns": "a rotation, as quaternion or angle [rad]",
    r"roll|fill_?|sliding_window_view|ListedColormap": "names of NumPy, Warp, Matplotlib",
    r"query_ball_point|fill(Convex)?Poly|_?least_squares": "names of SciPy and OpenCV; the field's least squares",
    r"fill_(doubtful_)?holes": "morphology's hole filling",
    r"(taught_|find_|vertex_)?[lL]ayers": "the layers of a folded cloth, public names",
    r"over": "what lies over a point, public: `Layers.over`",
    r"over_torque": "public attribute of `RobotState`: joints beyond their torque limits",
    r"known": "public argument of `nuno.fit_material`: the rest of the material",
    r"spread": "public attribute of `nuno.search.minimise.Generation`: a standard deviation",
    r"(is_)?root": "of a tree of joints",
    r"least": "public attribute of `nuno.bodies.resolution.Resolution`",
    r"SpreadTask|spread_task": "a task of `nuno.envs`: a cloth is spread on a table",
    r"(mjJNT_)?BALL|(project_)?ball(_joint)?": "the field's ball joint",
    r"listed_(position|rotation)": "where bodies were when rows were listed: a verb, and in saved states",
    r"lay_over|left_over|over_triangle|take_over": "verbs: to lay over, to be left over, to take over",
    r"(Get|Is)PseudoRoot|GetRootLayer": "names of usd-core",
    r"bvh_get_group_root|cast": "names of Warp and of typing",
    r"MOST": "shapes that one particle is held against, until `nuno.coupled` has another word",
    r"least_(force|squeeze)|most|rounds": "public names of `nuno.tasks.lift`: what a search found, and how far it goes",
}


def words_of(name):
    """Return the words of an identifier, in lower case."""
    return {part.lower() for part in re.findall(r"[A-Z]?[a-z0-9]+|[A-Z0-9]+", name)}


def found(folders, replaced):
    """Return the replaced words that identifiers have, as ``place: name: what it is called now``."""
    allowed = re.compile("|".join(f"(?:{pattern})" for pattern in ALLOWED))
    return sorted(
        f"{path.relative_to(PACKAGE).as_posix()}: {name}: {replaced[word]}"
        for folder in folders
        for path in sorted((PACKAGE / folder).rglob("*.py"))
        for name in identifiers(path)
        for word in words_of(name) & replaced.keys()
        if not allowed.fullmatch(name)
    )


def test_replaced_words_name_no_concept():
    """No identifier and no file name has a replaced word, but those that are allowed with a reason."""
    assert not found(FOLDERS, REPLACED)
    assert not found(("viewer",), IN_VIEWER)
    assert not found(KERNELS, IN_KERNELS)
    assert not found(("rigid",), {"those": IN_KERNELS["those"]})


def test_docstrings_begin_without_replaced_nouns():
    """No docstring's first line has one of the words that have no plain sense beside the one that was replaced."""
    word = re.compile(rf"\b({'|'.join(NOUNS)})\b")
    found = [
        f"{path.relative_to(PACKAGE).as_posix()}: {line}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for line in docstrings(path)
        if word.search(line.lower())
    ]
    assert not found


def test_every_exception_is_used():
    """An allowed name that nothing has is no exception."""
    names = {
        name
        for folder in (*FOLDERS, "viewer")
        for path in (PACKAGE / folder).rglob("*.py")
        for name in identifiers(path)
    }
    assert not [pattern for pattern in ALLOWED if not any(re.fullmatch(pattern, name) for name in names)]


INVENTED = re.compile(
    r"\b(yarns?|party|parties|convoys?|teams?|verdict|lessened|heed|haste|swift|crumpled|wardrobe|actors?|onlooker|awake|"
    r"soonest|led (frame|body|bodies)|flat windows?|taking turns|idle motion)\b", re.IGNORECASE
)  # fmt: skip
"""Words that this project had made up where the field has one."""
ROOT = Path(__file__).parents[1]


def test_docstrings_begin_without_invented_words():
    """No docstring's first line has such a word, nor what is named a ghost or a star where the field has another."""
    word = re.compile(INVENTED.pattern + r"|\b(star|ghost)\b", re.IGNORECASE)
    lines = [
        f"{path.relative_to(PACKAGE).as_posix()}: {text}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for text in docstrings(path)
        if word.search(text)
    ]
    assert not lines


@pytest.mark.parametrize("folder", ["tests", "benchmarks", "examples"])
def test_programs_have_no_invented_words(folder):
    """Nor have tests, benchmarks and examples, in names of files and identifiers or docstrings' first lines."""
    found = [
        f"{path.relative_to(ROOT).as_posix()}: {text}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for text in (path.stem, *identifiers(path), *docstrings(path))
        if INVENTED.search(text.replace("_", " "))
    ]
    assert not found


def test_documentation_has_no_invented_words():
    """Nor have the pages, beside those that say what the words were."""
    found = [
        f"{page.relative_to(ROOT).as_posix()}: {line}"
        for page in sorted((ROOT / "docs").rglob("*.md"))
        for line in page.read_text("utf-8").splitlines()
        if INVENTED.search(line)
    ]
    assert not found


def test_documentation_names_files_that_are_there():
    """A file in backticks, with its folder or without, is one of the sources."""
    names = {
        path.name for folder in ("src", "tests", "benchmarks", "examples") for path in (ROOT / folder).rglob("*.py")
    }
    found = [
        f"{page.relative_to(ROOT).as_posix()}: {place}"
        for page in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
        for place in re.findall(r"`((?:\w+/)*\w+\.py)`", page.read_text("utf-8"))
        if place.rpartition("/")[2] not in names
        or (
            "/" in place
            and not any((base / place).exists() for base in (ROOT, PACKAGE, PACKAGE.parent, ROOT / "tests"))
        )
    ]
    assert not found
