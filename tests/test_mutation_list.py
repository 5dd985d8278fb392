"""The mutations of benchmarks/mutation_list.py can be made: their text is there once, and so are their tests."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[1]


def mutations():
    """Return the list, which is in no package."""
    spec = importlib.util.spec_from_file_location("mutation_list", ROOT / "benchmarks" / "mutation_list.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.MUTATIONS


def test_every_mutation_can_be_made():
    """What a change of the package has made stale would be counted neither as killed nor as survived."""
    stale = []
    for _area, file, old, new, tests in mutations():
        text = (ROOT / "src" / "nuno" / file).read_text(encoding="utf-8")
        if text.count(old) != 1 or old == new or not all((ROOT / "tests" / name).exists() for name in tests.split()):
            stale.append((file, old))
    assert not stale
