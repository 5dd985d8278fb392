"""Every URDF of example-robot-data: read, moved in a world, and described by a guess; a minute in all."""

import pytest

import nuno
from nuno.errors import MeshError, RobotModelError
from nuno.robot.description import robot_data

# These name meshes that the package lacks, or are no robot to Pinocchio either.
UNREADABLE = {"romeo_laas_small": MeshError, "ur3": RobotModelError}
FILES = sorted(robot_data().glob("**/*.urdf"))


def test_there_are_files():
    """The package has some seventy."""
    assert len(FILES) > 60


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.parent.name}-{path.stem}")
def test_a_robot_moves_and_is_described(path, tmp_path):
    """A joint arrives where it is sent; the guessed table is one that a robot can be made by, and moves too."""
    if path.stem in UNREADABLE:
        with pytest.raises(UNREADABLE[path.stem]):
            nuno.Humanoid(path)
        return
    move(nuno.Humanoid(path))
    srdf = next((own for own in path.parent.parent.glob("srdf/*.srdf") if path.stem.startswith(own.stem)), None)
    nuno.describe_robot(path, tmp_path / "guess.toml", srdf=srdf)
    move(nuno.Humanoid(path.stem, robots=tmp_path / "guess.toml"))


def move(robot):
    """Move the last joint in a world by 0.1, as far as its limits let it."""
    world = nuno.World(device="cpu")
    driver = nuno.SimulatedRobot(robot, world)
    if robot.joint_names:
        joint, upper = robot.joint_names[-1], robot.joint_limits[1][-1]
        goal = min(driver.angle_vector()[-1] + 0.1, upper)
        driver.angle_vector({joint: goal}, 0.3)
        driver.wait_interpolation()
        assert driver.angle_vector()[-1] == pytest.approx(goal, abs=1e-3)
    world.step()
    driver.torque_vector()
    robot.self_collisions()
