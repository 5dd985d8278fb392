"""Private names: how often a module reaches into those of objects that another module declares."""

import ast

from package_sources import PACKAGE, nodes_of

MOST = 442
"""So many are left, after branches that were counted apart; who makes them fewer lowers it, and nothing raises it."""


def own_names(nodes):
    """Return the names that a module declares: functions, classes, fields, and what it sets on ``self``.

    Those of a protocol are others' names, which it only asks for.
    """
    found = set()
    classes = [node for node in nodes if isinstance(node, ast.ClassDef)]
    protocols = [node for node in classes if "Protocol" in map(ast.unparse, node.bases)]
    asked = {inner for protocol in protocols for inner in ast.walk(protocol)}
    for node in nodes:
        if node in asked:
            continue
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found.add(node.target.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and is_own(node.value):
            found.add(node.attr)
    return found


def is_own(node):
    """Return whether an expression is ``self`` or ``cls``."""
    return isinstance(node, ast.Name) and node.id in ("self", "cls")


def reaches(nodes):
    """Yield line and text of each ``other._name`` whose name the module does not declare itself."""
    own = own_names(nodes)
    for node in nodes:
        if isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
            if not is_own(node.value) and node.attr not in own:
                yield node.lineno, ast.unparse(node)


def test_modules_reach_into_few_privates():
    """Modules reach into other modules' privates no more often than before."""
    found = sorted(
        {
            f"{path.relative_to(PACKAGE).as_posix()}:{line} {text}"
            for path in PACKAGE.rglob("*.py")
            for line, text in reaches(nodes_of(path))
        }
    )
    assert len(found) <= MOST, "\n".join(found)


def test_the_search_sees_what_it_looks_for():
    """A reach into another object counts; one's own names, those of the same module and dunders do not."""
    text = "class A:\n    def f(self, a, b):\n        self._x = a._x + b._y + self._z + b.__dict__\n"
    assert [what for _, what in reaches(list(ast.walk(ast.parse(text))))] == ["b._y"]
    asking = "class A(Protocol):\n    def _y(self): ...\n\ndef f(a):\n    a._y()\n"
    assert [what for _, what in reaches(list(ast.walk(ast.parse(asking))))] == ["a._y"]
