"""The layers of the package: imports go one way, nothing lies flat at the top, and replaced words stay away."""

import ast
import re
from functools import cache

from package_sources import PACKAGE, docstrings, identifiers, nodes_of

DOOR = {"__init__", "__main__", "errors", "materials", "validation"}
# From the bottom up: a folder imports from those before it, and from itself.
LAYERS = (
    "errors", "validation", "materials", "mesh", "numbers", "topology", "state", "constraints", "contact.self",
    "contact.particle", "shapes", "rigid", "coupled", "plans", "kernels", "files", "bodies", "joints", "solvers",
    "tables", "dynamics", "engines", "camera", "world", "search", "envs", "estimate", "tracking", "robot", "viewer",
    "scenes", "tasks", "__init__", "__main__",
)  # fmt: skip
# Words that the field has others for: (part of an identifier or file name, what it is called now).
REPLACED = {
    "yarn": "grid line", "yarns": "grid lines", "star": "cluster", "stars": "clusters", "party": "island",
    "parties": "islands", "convoy": "path batch", "convoys": "path batches", "team": "block group",
    "teams": "block groups", "verdict": "residency", "lessened": "fused_subtract", "crumpled": "inverted",
    "haste": "shape speed", "swift": "fast", "heed": "contact weight", "wardrobe": "visual meshes",
    "actor": "scene object", "actors": "scene objects", "onlooker": "look-at camera", "soonest": "earliest",
    "awake": "active", "picked_triangle": "inner_triangle", "picked_edge": "inner_edge", "ghost": "held inverse mass",
}  # fmt: skip


@cache
def modules():
    """Return each module's name below ``nuno`` and its file."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = list(path.relative_to(PACKAGE).with_suffix("").parts)
        if parts[-1] == "__init__" and len(parts) > 1:
            parts.pop()
        found.append((".".join(parts), path))
    return found


def layer_of(module):
    """Return the layer that a module belongs to."""
    parts = module.split(".")
    return ".".join(parts[:2]) if parts[0] == "contact" and len(parts) > 1 else parts[0]


def imports_of(path, names):
    """Yield the modules that a module imports anywhere: at its top, in functions, and for its annotations alone."""
    for node in nodes_of(path):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "nuno":
            package = node.module[5:]
            for alias in node.names:
                inner = f"{package}.{alias.name}".strip(".")
                yield inner if inner in names else package or "__init__"


@cache
def edges():
    """Return which module imports which, by name below ``nuno``."""
    found = dict(modules())
    return {name: set(imports_of(path, found)) - {name} for name, path in found.items()}


def test_folders_import_one_way():
    """A module imports from its own folder and from those below it, for annotations too."""
    rank = {layer: k for k, layer in enumerate(LAYERS)}
    wrong = [
        f"{name} imports {other}"
        for name, others in edges().items()
        for other in others
        if rank[layer_of(other)] > rank[layer_of(name)]
    ]
    assert not wrong


def test_modules_import_in_no_circle():
    """No module imports one that imports it, by whatever way round, annotations included."""
    left = dict(edges())
    while ready := [name for name, others in left.items() if not others & left.keys()]:
        for name in ready:
            del left[name]
    assert not left


def test_nothing_lies_flat_at_the_top():
    """Beside the public door there are folders only, each of which has a layer."""
    assert {path.stem for path in PACKAGE.glob("*.py")} == DOOR
    folders = {path.parent.relative_to(PACKAGE).parts[0] for path in PACKAGE.glob("*/__init__.py")}
    assert folders <= {layer.split(".")[0] for layer in LAYERS}


def test_file_names_are_unique():
    """No two files of one name in different folders."""
    names = [path.name for path in PACKAGE.rglob("*.py") if path.name != "__init__.py"]
    assert sorted(names) == sorted(set(names))


def test_files_are_short():
    """No file has more than 400 lines, for past that there is a second concept in it."""
    lengths = {
        path.relative_to(PACKAGE).as_posix(): len(path.read_text().splitlines()) for path in PACKAGE.rglob("*.py")
    }
    assert not {place for place, lines in lengths.items() if lines > 400}


def test_replaced_words_name_nothing():
    """No identifier and no file has one of the words that the field has others for."""
    found = set()
    for path in sorted(PACKAGE.rglob("*.py")):
        place = path.relative_to(PACKAGE).as_posix()
        for name in identifiers(path):
            parts = {part.lower() for part in re.findall(r"[A-Z]?[a-z0-9]+|[A-Z0-9]+", name)}
            found |= {f"{place}: {name}: {REPLACED[word]}" for word in parts & REPLACED.keys()}
    assert not sorted(found)


def test_docstrings_begin_with_what_a_thing_is():
    """A docstring's first line names a thing or an action; it asks no question."""
    asking = re.compile(r"(What|How|Where|Whether|Which|When|Who|Whose|Return whether)\b")
    found = [f"{name}: {text}" for name, path in modules() for text in docstrings(path) if asking.match(text)]
    assert not found
