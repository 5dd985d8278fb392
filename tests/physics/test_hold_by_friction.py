"""Two fingers that press with given forces hold what is between them by friction alone, up to Coulomb's bound.

A palm slides up and down; of two fingers one stays where it is in the palm, and the other slides towards it by a motor
of limited force F. What they press stays where it is between them as long as 2 mu F > m (g + a), and slides else.
"""

import numpy as np
import pytest

import nuno
from nuno.shapes import quaternion

G = 9.81
MU = 0.5
PALM, FINGER = 1.0, 0.05  # [kg]
FAR, SPAN = 0.5, 1.0  # [m], [s] of the way that things are carried
PEAK = 10.0 / np.sqrt(3.0) * FAR / SPAN**2  # [m/s2] of a minimum-jerk way
MATERIALS = {
    "cube": (0.025, 0.5),  # half its thickness [m], its mass [kg]
    "towel": (0.001, 0.4 * 0.2 * 0.3),
    "cloth mat": (0.002, 1.2 * 0.2 * 0.2),
    "soft mat": (0.01, 200.0 * 0.2 * 0.02 * 0.2),
}
UPRIGHT = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
ON_A_CORNER = (np.cos(np.pi / 8), 0.0, np.sin(np.pi / 8), 0.0)


def thing(kind):
    """Return a body that hangs down between the fingers, its edge or corner up there, and its material."""
    if kind == "cube":
        return nuno.box((0.05,) * 3, name=kind, position=(0, 0, 1)), nuno.Rigid(mass=0.5, friction=MU)
    if kind == "towel":  # held at its upper edge
        body = nuno.sheet((0.2, 0.3), (20, 30), name=kind, position=(0, 0, 0.87), quaternion=UPRIGHT)
        return body, nuno.Cloth(area_density=0.4, thickness=2e-3, friction=MU, damping=0.02)
    low = 1.03 - 0.1 * np.sqrt(2.0)  # held at a corner, and hanging straight down from there
    if kind == "soft mat":
        body = nuno.soft_box((0.2, 0.02, 0.2), (10, 2, 10), name=kind, position=(0, 0, low), quaternion=ON_A_CORNER)
        return body, nuno.Soft(youngs_modulus=1e5, poisson_ratio=0.3, density=200.0, friction=MU, damping=0.05)
    turn = quaternion.multiply(np.array(ON_A_CORNER), np.array(UPRIGHT))
    body = nuno.sheet((0.2, 0.2), (20, 20), name=kind, position=(0, 0, low), quaternion=turn)
    return body, nuno.Cloth(area_density=1.2, thickness=4e-3, bending_rigidity=1e-3, friction=MU, damping=0.02)


class Gripper:
    """A palm on a slider, with two fingers that press a thing with a force each [N]."""

    def __init__(self, kind, force, **options):
        half, self.mass = MATERIALS[kind]
        self.world = world = nuno.World(device="cpu", **options)
        body, material = thing(kind)
        self.held = world.add(body)
        world.attach(self.held, material)
        self.palm = world.add(nuno.box((0.04, 0.2, 0.02), name="palm", position=(0, 0, 1.1)))
        world.attach(self.palm, nuno.Rigid(mass=PALM))
        self.lift = nuno.slider(self.palm, None, axis=(0, 0, 1))
        self.fingers = []
        for side in (-1.0, 1.0):
            place = (0.0, side * (half + 0.005) + max(0.0, 0.002 * side), 1.0)
            finger = world.add(nuno.box((0.03, 0.01, 0.04), name=f"finger{side:+.0f}", position=place))
            world.attach(finger, nuno.Rigid(mass=FINGER, friction=MU))
            motor = nuno.Motor(velocity=0.05, max_effort=force) if side > 0.0 else nuno.Motor(velocity=0.0)
            self.fingers.append(nuno.slider(finger, self.palm, axis=(0, -side, 0), motor=motor))
        low = self.held.vertices[:, 2].min()
        table = world.add(nuno.box((0.5, 0.3, 0.01), name="table", position=(0, 0, low - 0.0055)))
        self.lift.motor = nuno.Motor(velocity=0.0)
        world.run(0.4)  # the fingers close
        world.remove(table)
        local = self.held.vertices - self.palm.position + (0.0, 0.0, 0.1)
        self.between = np.flatnonzero((np.abs(local[:, [0, 2]]) < 0.02).all(axis=1))
        if kind == "cube":
            self.between = np.arange(len(local))
        self.start = self.height()

    def height(self):
        """Return how high what is between the fingers is against the palm [m]."""
        return self.held.vertices[self.between, 2].mean() - self.palm.position[2]

    def slip(self):
        """Return how far the thing has slid down between the fingers [m]."""
        return self.start - self.height()

    def carry(self):
        """Lift the palm by ``FAR`` in ``SPAN`` along a minimum-jerk way; return the most that the thing slid [m]."""
        most, frame = 0.0, 1.0 / self.world.frame_rate
        for k in range(round((SPAN + 0.2) / frame)):
            s = min((k + 0.5) * frame / SPAN, 1.0)  # in the middle of the frame
            place, speed = FAR * s**3 * (10 - 15 * s + 6 * s * s), FAR / SPAN * 30 * (s - s * s) ** 2
            pull = (PALM + 2.0 * FINGER + self.mass) * (G + FAR / SPAN**2 * 60 * s * (1 - s) * (1 - 2 * s))
            late = place - 0.5 * frame * speed - self.lift.position
            self.lift.motor = nuno.Motor(speed + 5.0 * late, damping=30.0, effort=pull)
            self.world.step()
            most = max(most, abs(self.slip()))
        assert self.lift.position == pytest.approx(FAR, abs=0.02)
        return most


def bound(kind, acceleration=0.0):
    """Return the force [N] of each finger at which a thing begins to slide."""
    return MATERIALS[kind][1] * (G + acceleration) / (2.0 * MU)


@pytest.mark.parametrize("share", [0.8, 1.2])
def test_a_lifted_cube_slides_as_coulomb_says(share):
    """The palm is pulled up with 4 m/s2 for 0.1 s: below the bound the cube lags by (1 - share) (g + a) t^2 / 2.

    Above it stays, within 0.1 mm.
    """
    a, span = 4.0, 0.1
    gripper = Gripper("cube", share * bound("cube", a))  # enough at rest in either case
    borne = min(share, 1.0) * gripper.mass * (G + a)
    pull = (PALM + 2.0 * FINGER) * (G + a) + borne
    held = 0.5 * (1.0 - min(share, 1.0)) * (G + a) * span**2
    gripper.lift.motor = nuno.Motor(effort=pull)
    gripper.world.run(span)
    substep = span / 6 / 10
    assert gripper.lift.position == pytest.approx(0.5 * a * span * (span + substep), rel=0.02)
    assert gripper.slip() == pytest.approx(held, rel=0.03, abs=1e-4)


MARKS = {"cube": (), "cloth mat": pytest.mark.slow}
"""A mat of cloth is held as a towel is."""


@pytest.mark.parametrize("kind", [pytest.param(kind, marks=MARKS.get(kind, pytest.mark.long)) for kind in MATERIALS])
def test_things_are_carried_by_friction_alone(kind):
    """0.5 m up in 1 s: with 1.2 times the bound's force nothing slides by more than 0.5 mm."""
    assert Gripper(kind, 1.2 * bound(kind, PEAK)).carry() < 5e-4


@pytest.mark.parametrize("kind", [pytest.param(kind, marks=MARKS.get(kind, pytest.mark.long)) for kind in MATERIALS])
def test_things_slip_where_friction_is_too_small(kind):
    """With 0.8 times the force that holds the weight at rest, they slide down, and out."""
    gripper = Gripper(kind, 0.8 * bound(kind))
    gripper.world.run(0.1)
    assert gripper.slip() > 0.0
    gripper.world.run(0.5)
    assert gripper.slip() > 0.05
