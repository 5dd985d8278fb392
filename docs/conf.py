"""Sphinx: ``sphinx-build -W docs out/docs``."""

import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
sys.path[:0] = [str(DOCS), str(DOCS.parent / "src")]  # gallery.py, and this checkout's Nuno

import nuno  # noqa: E402

project = "Nuno"
author = "The Nuno authors"
copyright = f"2026, {author}"
release = nuno.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "gallery",
]
exclude_patterns = ["out"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 4
html_theme = "furo"
html_title = f"Nuno {release}"
default_role = "code"

autodoc_member_order = "bysource"
autodoc_typehints = "description"  # types are listed with the arguments, not in signatures
autodoc_typehints_description_target = "all"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True

# A reference that leads nowhere is an error. Pages are built without a network, so other packages' are not looked up.
nitpicky = True
nitpick_ignore_regex = [
    ("py:.*", r"(np|numpy|warp|collections|concurrent|contextlib|os|pathlib|matplotlib|trimesh|PIL|pinocchio)\..*"),
    ("py:class", r"(.*\.Self|ArrayLike|Figure|Executor)"),  # others' types, which are imported for type checkers only
    ("py:class", r"(Arms|Color|FileName|Mode|RealTimeFactor)"),  # names for a union of types
    ("py:class", r"DeviceArray"),  # Warp's arrays, under a name for type checkers
    # What a result holds for other functions to take
    ("py:class", r"(.*\.)?(ArmPlan|BodyRecord|CarryPlan|FoldComparison|Futures|GripRecord|RigidLayout)"),
    ("py:class", r"(.*\.)?(HoldView|ImageSource)"),
    ("py:class", r"(.*\.)?(GripSpec|ImageReading|ImaginedRobot|Scene|Schedule|SoftTopology|States|WalkPlanner)"),
    ("py:class", r"(.*\.)?(ContactRules|Formula|GripOrder|Sent|Simulation|WalkOrder)"),
    # What a narrower type or a protocol says of a public class
    ("py:class", r"(.*\.)?(EngineWorld|LearntFold|OriginalRobot|Robot|WalkSettings)"),
]


def setup(app: Any) -> None:
    """Keep Napoleon from taking the words before a colon in a property's first line for its type."""
    app.connect("autodoc-process-docstring", begin_with_a_blank, priority=400)


def begin_with_a_blank(_app: Any, kind: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Put an empty word before the docstring of a property or an attribute."""
    if kind in ("property", "attribute", "data"):
        lines.insert(0, "\\ ")
