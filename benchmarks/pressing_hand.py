"""A hand that presses a soft cube on a table, in Nuno and with the arm in MuJoCo; for `robot_against_mujoco.py`.

Talos' base is fixed; motors of the same gains lead a plate below its right hand 25 mm into a cube of 0.1 m, 20 kPa.
With the arm in MuJoCo the cube stays Nuno's: in each step the plate is where MuJoCo has it, and what the cube does to
it is a force on the hand there.
"""

from __future__ import annotations

import statistics
import time
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from robot_in_mujoco import MujocoRobot

import nuno
from nuno.robot.link_dynamics import LinkDynamics

RATE = 60.0
STEPS = 20
"""Of such a frame: 0.83 ms each."""
GAP, DEEP, SECONDS, HOLDS = 0.005, 0.03, 1.0, 1.5
"""[m] Above the cube, and how far the hand goes down; in [s], and after that [s]."""
SOFT = 0.02
"""[rad] By which a motor at its effort limit gives way."""
EDGE, CELLS, YOUNG = 0.1, 6, 2e4
PLATE, MASS = (0.08, 0.08, 0.01), 0.2
"""[m] and [kg], level, below what is lowest of the hand."""
LINK = "arm_right_7_link"


def talos() -> nuno.Humanoid:
    """Return Talos with a base that stays where it is."""
    known = nuno.Humanoid("talos")
    known.angle_vector({"gripper_left_joint": -0.5, "gripper_right_joint": -0.5, "arm_right_4_joint": -1.2})
    own = nuno.Humanoid(known.description.urdf)
    own.angle_vector(known.angle_vector())
    return own


def frame_of_hand(robot: nuno.Humanoid) -> int:
    """Return the index of the hand's frame, the gripper's base."""
    return robot.frame_index("gripper_right_base_link")


def way_down(robot: nuno.Humanoid) -> np.ndarray:
    """Return the joint angles (n,) by which the hand is lower, turned as it is."""
    model, data = robot.model, robot.model.createData()
    arm = [6 + robot.joint_index(f"arm_right_{k}_joint") for k in range(1, 8)]
    q, frame = robot.configuration(), frame_of_hand(robot)
    pin.framesForwardKinematics(model, data, q)
    goal = data.oMf[frame].copy()
    goal.translation = goal.translation - (0.0, 0.0, DEEP)
    for _ in range(50):
        pin.framesForwardKinematics(model, data, q)
        place = data.oMf[frame]
        off = np.concatenate([goal.translation - place.translation, pin.log3(goal.rotation @ place.rotation.T)])
        jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:, arm]
        v = np.zeros(model.nv)
        v[arm] = np.linalg.pinv(jacobian) @ off
        q = pin.integrate(model, q, v)
    return robot.angles_of(q)


def gains(robot: nuno.Humanoid) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and damping of the motors (n,)."""
    inertia = np.array(pin.crba(robot.model, robot.model.createData(), robot.configuration())).diagonal()[6:]
    stiffness = robot.effort_limits / SOFT
    return stiffness, 2.0 * np.sqrt(stiffness * inertia)


def below_hand(robot: nuno.Humanoid) -> np.ndarray:
    """Return where the plate's middle is (3,) [m]."""
    world = nuno.World(device="cpu")
    links = robot.copy().enter(world, "joints")
    low = min(
        (body.vertices for body in links.bodies if "arm_right_7" in body.name or "gripper_right" in body.name),
        key=lambda vertices: vertices[:, 2].min(),
    )
    tip = low[low[:, 2] < low[:, 2].min() + 0.01].mean(axis=0)
    return np.array((tip[0], tip[1], low[:, 2].min() - 0.5 * PLATE[2] - 1e-3))


def room(rate: float, substeps: int, place: np.ndarray) -> tuple[nuno.World, Any, Any]:
    """Return a world with a table, a cube and a plate above it, the cube, and the plate."""
    world = nuno.World(device="cpu", frame_rate=rate, substeps=substeps)
    x, y, top = place[0], place[1], place[2] - 0.5 * PLATE[2] - GAP
    world.add(nuno.box((0.3, 0.3, 0.1), name="table", position=(x, y, top - EDGE - 0.05), friction=0.8))
    cube = nuno.soft_box((EDGE,) * 3, (CELLS,) * 3, mean_strain=True, name="cube", position=(x, y, top - 0.5 * EDGE))
    world.attach(world.add(cube), nuno.Soft(youngs_modulus=YOUNG, damping=0.01, friction=0.8))
    return world, cube, world.add(nuno.box(PLATE, name="plate", position=place, friction=0.8))


def inverse_force(robot: nuno.Humanoid, q: np.ndarray, torques: np.ndarray) -> np.ndarray:
    """Return the force (3,) [N] on the hand by which a still arm's torques are those of inverse dynamics."""
    model, data = robot.model, robot.model.createData()
    arm = [robot.joint_index(f"arm_right_{k}_joint") for k in range(1, 8)]
    extra = torques - pin.computeGeneralizedGravity(model, data, q)[6:]
    jacobian = pin.computeFrameJacobian(model, data, q, frame_of_hand(robot), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    found = -np.linalg.lstsq(jacobian[:, 6:][:, arm].T, extra[arm], rcond=None)[0][:3]
    return found + np.array((0.0, 0.0, 9.81 * MASS))  # less the plate's weight


def summary(
    robot: nuno.Humanoid, q: np.ndarray, torques: np.ndarray, force: Any, places: list[np.ndarray], spent: list[float],
    rate: float,
) -> dict[str, Any]:  # fmt: skip
    """Return the figures of a run: forces [N], the wander of the cube [mm/s], and what a simulated second costs."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    half = int(0.5 * rate)
    wander = np.linalg.norm(np.diff(places[-half:], axis=0), axis=1).sum() / 0.5
    return {
        "hand": float(data.oMf[frame_of_hand(robot)].translation[2]),
        "force": float(force[2]), "inverse": float(inverse_force(robot, q, torques)[2]),
        "wander": 1000.0 * float(wander), "cpu": rate * statistics.median(spent), "angles": robot.angles_of(q).tolist(),
    }  # fmt: skip


def force_on(world: nuno.World, cube: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the force that a cube does to what presses it from above, and its moment about the origin (3,) each."""
    found = world.contacts(cube)
    above = np.array([name != "table" for name in found.others], dtype=bool)
    forces, points = -np.asarray(found.forces)[above], np.asarray(found.points)[above]
    return forces.sum(axis=0), np.cross(points, forces).sum(axis=0)


def in_nuno() -> dict[str, Any]:
    """Run the scene in Nuno alone."""
    robot = talos()
    start, goal = robot.angle_vector(), way_down(robot)
    world, cube, plate = room(RATE, STEPS, below_hand(robot))
    links = robot.enter(world, "joints")
    dynamics = LinkDynamics(links)
    dynamics.attach()
    world.attach(plate, nuno.Rigid(mass=MASS, friction=0.8))
    for body in links.bodies:
        world.ignore_contact(plate, body)
        world.ignore_contact(cube, body)
    nuno.fixed_joint(plate, links.bodies[links.names.index(LINK)])
    nothing, (stiffness, damping) = np.zeros(len(start)), gains(robot)
    places, spent, forces = [], [], []
    for frame in range(round((SECONDS + HOLDS) * RATE)):
        share = min(1.0, (frame + 1) / RATE / SECONDS)
        dynamics.drive(start + share * (goal - start), nothing, stiffness, damping, nothing)
        begun = time.process_time()
        world.step()
        spent.append(time.process_time() - begun)
        places.append(np.asarray(cube.vertices).mean(axis=0))
        forces.append(force_on(world, cube)[0])
    q = dynamics.read()[0][0]
    return summary(robot, q, dynamics.felt(1.0 / RATE)[2][0], np.mean(forces[-6:], axis=0), places, spent, RATE)


def with_mujoco() -> dict[str, Any]:
    """Run the scene with the arm in MuJoCo, exchanging forces in each of its steps."""
    robot = talos()
    start, goal = robot.angle_vector(), way_down(robot)
    rate, place = RATE * STEPS, below_hand(robot)
    arm = MujocoRobot(robot, 1.0 / rate, afloat=False, loads={LINK: (MASS, place)})
    arm.limit(robot.effort_limits + np.array(robot.model.upperDryFrictionLimit[6:]))
    world, cube, plate = room(rate, 1, place)
    load = mujoco.mj_name2id(arm.model, mujoco.mjtObj.mjOBJ_BODY, f"{LINK}_load")
    nothing, (stiffness, damping) = np.zeros(len(start)), gains(robot)
    places, spent, forces = [], [], []
    poses = [(arm.data.xpos[load].copy(), arm.data.xquat[load].copy())] * 2
    for step in range(round((SECONDS + HOLDS) * rate)):
        share = min(1.0, (step + 1) / rate / SECONDS)
        arm.drive(start + share * (goal - start), nothing, stiffness, damping, nothing)
        begun = time.process_time()
        arm.advance(1)
        poses = [poses[1], (arm.data.xpos[load].copy(), arm.data.xquat[load].copy())]
        now = world.time
        world.move(plate, nuno.Path([now, now + 1.0 / rate], *(list(part) for part in zip(*poses, strict=True))))
        world.step()
        force, moment = force_on(world, cube)
        arm.data.xfrc_applied[load, :3] = force
        arm.data.xfrc_applied[load, 3:] = moment - np.cross(arm.data.xipos[load], force)
        spent.append(time.process_time() - begun)
        places.append(np.asarray(cube.vertices).mean(axis=0))
        forces.append(force)
    return summary(robot, arm.read()[0], arm.torques(), np.mean(forces[-6 * STEPS :], axis=0), places, spent, rate)


def press() -> dict[str, Any]:
    """Run and print the scene both ways."""
    found = {"nuno": in_nuno(), "mujoco": with_mujoco()}
    apart = np.abs(np.subtract(*(own["angles"] for own in found.values()))).max()
    print(f"angles apart: {1000.0 * apart:.2f} mrad")
    print("| | height of the hand [m] | force [N] | by the arm's torques | wander of the cube [mm/s] | CPU s/s |")
    print("|---|---|---|---|---|---|")
    for name, own in found.items():
        print(f"| {name} | {own['hand']:.4f} | {own['force']:.2f} | {own['inverse']:.2f} | {own['wander']:.3f} | "
              f"{own['cpu']:.2f} |", flush=True)  # fmt: skip
    return found
