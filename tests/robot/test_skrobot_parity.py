"""The interface has the signatures of scikit-robot's interface to a real robot, read from its source."""

from __future__ import annotations

import ast
import inspect
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import pytest

from nuno.robot.interface import RobotInterface

SOURCES = {
    "base.py": "ROSRobotInterfaceBase",
    "move_base.py": "ROSRobotMoveBaseInterface",
    "pr2.py": "PR2ROSRobotInterface",
    "ros2": "ROS2RobotInterfaceBase",
}
JOINTS = (
    "add_controller", "angle_vector", "angle_vector_duration", "angle_vector_sequence",
    "default_controller", "is_interpolating", "is_moving", "potentio_vector", "sub_angle_vector", "update_robot_state",
    "wait_interpolation",
)  # fmt: skip
BASE = (
    "go_pos", "go_pos_unsafe", "go_stop", "go_velocity", "move_to", "move_to_send", "move_to_wait", "move_trajectory",
)  # fmt: skip
NAMED = ("angle_vector_from_names", "cancel_angle_vector")


@pytest.fixture(scope="module")
def signatures():
    """By file and method, the arguments and defaults of scikit-robot's; it cannot be imported without ROS."""
    pytest.importorskip("skrobot")
    assert version("scikit-robot") == "0.4.7"
    folder = Path(find_spec("skrobot").origin).parent / "interfaces" / "ros"
    found = {}
    for file, kind in SOURCES.items():
        tree = ast.parse((folder.parent / "ros2" / "base.py" if file == "ros2" else folder / file).read_text())
        body = next(node.body for node in tree.body if isinstance(node, ast.ClassDef) and node.name == kind)
        found[file] = {item.name: _arguments(item) for item in body if isinstance(item, ast.FunctionDef)}
    return found


def _arguments(function: ast.FunctionDef) -> list[tuple[str, object]]:
    names = [argument.arg for argument in function.args.args]
    defaults = [ast.literal_eval(value) for value in function.args.defaults]
    given = [inspect.Parameter.empty] * (len(names) - len(defaults)) + defaults
    return list(zip(names, given, strict=True))


def _own(name: str) -> list[tuple[str, object]]:
    parameters = inspect.signature(getattr(RobotInterface, name)).parameters.values()
    return [(own.name, own.default) for own in parameters]


@pytest.mark.parametrize("name", JOINTS)
def test_joints(signatures, name):
    """Names, order and defaults of what moves and reads joints."""
    assert _own(name) == signatures["base.py"][name]


@pytest.mark.parametrize("name", BASE)
def test_base(signatures, name):
    """Names, order and defaults of what moves the base."""
    assert _own(name) == signatures["move_base.py"][name]


@pytest.mark.parametrize("name", NAMED)
def test_what_ros_2_adds(signatures, name):
    """Names, order and defaults of what only its interface for ROS 2 has."""
    assert _own(name) == signatures["ros2"][name]


def test_grippers(signatures):
    """As those of its robot with two arms and two grippers."""
    assert _own("move_gripper") == signatures["pr2.py"]["move_gripper"]


def test_controllers_are_described_alike(signatures, still_talos):
    """A controller's description has the same keys."""
    folder = Path(find_spec("skrobot").origin).parent / "interfaces" / "ros"
    tree = ast.parse((folder / "base.py").read_text())
    call = next(
        node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name == "default_controller"
    ).body[0].value.elts[0]  # fmt: skip
    keys = {keyword.arg for keyword in call.keywords}
    made = RobotInterface.default_controller(type("OnlyTheModel", (), {"robot": still_talos})())
    assert all(set(own) == keys for own in made)
