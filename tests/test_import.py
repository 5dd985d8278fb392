"""``import nuno`` is light: what takes long to load is loaded where it is used."""

import pkgutil
import subprocess
import sys
from importlib import import_module
from types import ModuleType

import nuno

HEAVY = ("warp", "cv2", "trimesh", "matplotlib", "pinocchio", "scipy", "meshcat")


def loaded_after(code):
    """Return which heavy packages a fresh process has loaded after ``code``."""
    code += f"\nimport sys\nprint(*[name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_import_loads_nothing_heavy():
    """Neither Warp, nor OpenCV, nor a mesh, plotting or robot library."""
    assert loaded_after("import nuno") == []


def test_a_room_of_static_shapes_loads_nothing_heavy():
    """A world in which nothing is attached needs no solver, also while its time passes."""
    code = """
import nuno
world = nuno.World(device="cpu")
table = world.add(nuno.box((1, 1, 0.02)))
world.add(nuno.sheet((0.5, 0.5), cells=(10, 10), position=(0, 0, 1)))
table.locate((0, 0, 0.7))
world.run(1.0)
"""
    assert loaded_after(code) == []


def test_every_public_name_is_there():
    """What ``__all__`` lists can be had, is sorted, and shows in ``dir``."""
    assert nuno.__all__ == sorted(nuno.__all__)
    for name in nuno.__all__:
        assert getattr(nuno, name) is not None
    assert set(nuno.__all__) <= set(dir(nuno))


def test_no_public_name_is_taken_by_a_module():
    """Loading a module sets its name in the package: a name that is loaded on first use must not be that of one."""
    for module in pkgutil.iter_modules(nuno.__path__):
        if module.name in nuno.__all__:
            import_module(f"nuno.{module.name}")
            assert not isinstance(getattr(nuno, module.name), ModuleType)


def test_packages_are_reached_by_their_names():
    """docs/learning.md says ``nuno.envs``: it is there after ``import nuno``; what is no package is not."""
    code = "import nuno; print(nuno.envs.__name__, hasattr(nuno, 'nothing'), hasattr(nuno, '_repr_html_'))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["nuno.envs", "False", "False"]
