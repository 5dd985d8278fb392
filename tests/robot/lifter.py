"""A robot of one slide and one hand, whose two fingers the model fixes as it fixes those of Talos."""

import numpy as np

import nuno

G = 9.81
INERTIA = '<inertia ixx="2e-3" iyy="2e-3" izz="2e-3" ixy="0" ixz="0" iyz="0"/>'


def finger(name, y):
    """Return a finger's link, a pad of 0.03 x 0.01 x 0.04 m whose inner face is 0.04 m from the middle."""
    return f"""<link name="{name}"><inertial><origin xyz="0 {y} 0"/><mass value="0.05"/>
        <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><origin xyz="0 {y} 0"/><geometry><box size="0.03 0.01 0.04"/></geometry></collision></link>
      <joint name="{name}_joint" type="fixed"><parent link="palm"/><child link="{name}"/></joint>"""


URDF = f"""<robot name="lifter">
  <link name="body"><inertial><mass value="5"/>{INERTIA}</inertial></link>
  <link name="palm"><inertial><origin xyz="0 0 0.1"/><mass value="0.9"/>{INERTIA}</inertial>
    <collision><origin xyz="0 0 0.1"/><geometry><box size="0.04 0.2 0.02"/></geometry></collision></link>
  <link name="crank"><inertial><mass value="0.01"/>
    <inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  {finger("a", 0.045)}{finger("b", -0.045)}
  <joint name="lift" type="prismatic"><parent link="body"/><child link="palm"/><axis xyz="0 0 1"/>
    <limit lower="-0.1" upper="1" effort="200" velocity="3"/></joint>
  <joint name="turn" type="revolute"><parent link="palm"/><child link="crank"/><axis xyz="1 0 0"/>
    <origin xyz="0 0 0.15"/><limit lower="-1" upper="0" effort="20" velocity="2"/></joint>
</robot>"""

TABLE = """[lifter]
urdf = "lifter.urdf"
[lifter.frames]
right_hand = { link = "palm" }
right_wrist = { link = "palm" }
[lifter.hands.right_hand]
low = [-0.015, -0.04, -0.02]
high = [0.015, 0.04, 0.02]
joint = "turn"
open = 0.0
closed = -0.5
width = 0.08
fingers = [["a"], ["b"]]
"""


def lifter_in(folder, world, fingers=True, **options):
    """Return the robot in a world, its hand open between z = 0.98 and 1.02 m; without fingers it grips."""
    (folder / "lifter.urdf").write_text(URDF)
    (folder / "robots.toml").write_text(TABLE if fingers else TABLE[: TABLE.index("fingers")])
    robot = nuno.Humanoid("lifter", robots=folder / "robots.toml")
    robot.translate((0.0, 0.0, 1.0))
    return nuno.SimulatedRobot(robot, world, **options)


def cube_in(world, *, mass=0.5, friction=0.5, edge=0.05):
    """Return a cube between the fingers, and a grip that keeps it there."""
    cube = world.add(nuno.box((edge,) * 3, name="cube", position=(0.0, 0.0, 1.0)))
    world.attach(cube, nuno.Rigid(mass=mass, friction=friction))
    return cube, world.grip(cube, to=cube.position)


def lift(robot, held, far=0.5, span=1.0, mass=1.01):
    """Lift the hand along a minimum-jerk way under a torque law; return the most that something slid in it [m].

    Args:
        robot: The robot.
        held: (robot) -> height of what is held in the hand [m].
        far: [m].
        span: [s].
        mass: Of all that the slide bears [kg].
    """
    start, most, frame = held(robot), 0.0, 1.0 / robot.world.frame_rate
    for k in range(round((span + 0.2) / frame)):
        s = min((k + 0.5) * frame / span, 1.0)
        place, speed = far * s**3 * (10 - 15 * s + 6 * s * s), far / span * 30 * (s - s * s) ** 2
        pull = mass * (G + far / span**2 * 60 * s * (1 - s) * (1 - 2 * s))
        late = place - 0.5 * frame * speed - robot.state().q[robot.actual.model.joints[2].idx_q]
        robot.servo(nuno.ServoCommand(("lift",), q=0.0, kp=0.0, dq=speed + 5.0 * late, kd=30.0, tau=pull))
        robot.world.step()
        most = max(most, abs(held(robot) - start))
    return most


def height(body):
    """Return a function that tells how high a rigid body is above the hand's origin [m]."""
    return lambda robot: float(body.position[2] - robot.actual.frame_pose("right_hand").position[2])


PEAK = 10.0 / np.sqrt(3.0) * 0.5
"""[m/s2] Of a lift by 0.5 m in 1 s."""


def assert_same(found, expected):
    """Nothing differs in a bit."""
    assert [name for name, own in expected.items() if not np.array_equal(found[name], own)] == []


def assert_all_become(world, spans, expected, alone, states_of):
    """A world, a copy of it and the world restored are as expected, once each has run through spans [s].

    Args:
        world: With a robot.
        spans: One run each.
        expected: What they become, by name.
        alone: (world, robot) -> what there is to see of a world.
        states_of: (futures) -> the same of each world of a batch.
    """
    kept, copies = world.save(), world.imagine(1)
    for own in (world, copies):
        for span in spans:
            own.run(span)
    assert_same(alone(world, world.robot), expected)
    assert_same(states_of(copies)[0], expected)
    world.restore(kept)
    for span in spans:
        world.run(span)
    assert_same(alone(world, world.robot), expected)
