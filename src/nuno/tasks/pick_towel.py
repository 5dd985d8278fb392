"""Picking a towel and telling where it is held: a program for a humanoid that has a world of its own in its head.

All that it gets of the room is the robot's driver (joint readings, motions, grippers), the images of its two head
cameras, and where the table is. What it thinks is in ``TowelPicker.world``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nuno.bodies.body import Body
from nuno.bodies.make_bodies import box, plane, sheet
from nuno.camera.camera import Camera
from nuno.camera.rectangle import ClothRectangle, fit_rectangle
from nuno.camera.regions import grow
from nuno.camera.segmentation import segment_before
from nuno.camera.table import Table
from nuno.errors import EstimationError, InvalidInputError, ReachError
from nuno.estimate.pick import estimate_pick
from nuno.estimate.pick_result import PickResult
from nuno.materials import Cloth
from nuno.robot.head_cameras import STEREO, HeadCameras
from nuno.robot.humanoid import Humanoid
from nuno.robot.links import Links
from nuno.robot.stereo import triangulate
from nuno.shapes.coordinates import Coordinates
from nuno.shapes.path import Path, minimum_jerk
from nuno.tasks.free_way import free_way
from nuno.tasks.hand_beads import BEAD_AT, find_bead, put_beads
from nuno.tasks.obstacles import Obstacles
from nuno.validation import checked
from nuno.world.world import World

LEAN = {"torso_1_joint": 0.0, "torso_2_joint": 0.45, "head_1_joint": 0.785, "head_2_joint": 0.0}
"""[rad] How Talos looks down on the table: the trunk forward, the head as far down as it goes."""
TRUNK = ("base_link", "torso_2_link")
"""Frames that keep their place while an arm reaches, and the head with it: all images are taken from one place."""
ARMS = {"left_hand": "larm", "right_hand": "rarm"}
DOWN = (0.0, 1.0, 0.0, 0.0)
"""Of a hand that points straight down, (w, x, y, z)."""
TOWARDS = {"left_hand": -0.8, "right_hand": 0.8}
"""[rad] Azimuth in which a hand points beside down: ahead and inwards, so that the arm comes from outside."""
SLANT = 0.35
"""[rad] Of a hand from straight down: one edge of its fingers is lowest, and pinches a small piece of cloth."""
PINCH = (-0.025, 0.0, 0.042)
"""[m] In the frame of the hand, the middle of what it then takes of a cloth 5 mm above that edge."""
OPENING = 0.25
"""Of a hand that goes down to pinch, 0 (closed) to 1: the fingers are 23 mm apart."""
ABOVE = 0.08
"""[m] Over a point that is to be pinched; from there the hand comes straight down."""
SHOWN = {"left_hand": (0.6, 0.04, 0.24), "right_hand": (0.6, -0.02, 0.24)}
"""[m] Where what is held is looked at: x, y and above the table."""
APPROACH_SECONDS, LIFT_SECONDS, REST_SECONDS = 1.5, 2.0, 3.0
CLEARANCE = 0.01
"""[m] By which the arm keeps away from the table as it goes to the towel."""
STOPPED = 0.05
"""[rad] Off what was asked for, from which on a motion did not get there."""
PIECES = 8
"""Of a straight way of the hand, joint angles being interpolated within each."""
CELLS = (20, 15)
"""Of the towel in the robot's own world."""
RIM = 3
"""[px] Around the robot's own outline, which counts as its own: an outline is known to about that."""


@dataclass(frozen=True, eq=False)
class Look:
    """The robot's view at one time, and what it knows of itself then.

    Attributes:
        images: RGB (h, w, 3) uint8 by camera.
        cameras: The cameras, by the joints' readings.
        own: (h, w) bool by camera, where the robot's own body is in the image, by the joints' readings.
    """

    images: Mapping[str, np.ndarray] = field(repr=False)
    cameras: Mapping[str, Camera] = field(repr=False)
    own: Mapping[str, np.ndarray] = field(repr=False)


@dataclass(frozen=True, eq=False)
class Answer:
    """The point at which the robot says it holds the towel.

    Attributes:
        pick: (i, j) of the candidates' grid.
        result: All of the estimate.
        held: (3,) [m], where the held point is, by stereo.
        deviation: [m], standard deviation of it along its most uncertain direction.
        by_joints: (3,) [m], the same by the joints' readings; not used, but to compare.
        before: What was seen before.
        after: What was seen after.
    """

    pick: tuple[int, int]
    result: PickResult = field(repr=False)
    held: np.ndarray
    deviation: float
    by_joints: np.ndarray
    before: Look = field(repr=False)
    after: Look = field(repr=False)


class TowelPicker:
    """A program that finds a towel on a table, picks it up, and tells from images at which point it holds it.

    Args:
        driver: The driver of a Talos, real or simulated, whose head cameras ("head_left", "head_right") show images.
        table: Where the table is.
        rest_height: Height of a cloth's middle surface above the table [m].
        device: Where to simulate, as of ``World``.

    Raises:
        InvalidInputError: a table without ends.

    Attributes:
        world: What the robot knows of the room: table, floor, its own links, and the towel once it has been found.
        robot: The robot in that world.
        cameras: Its cameras there.
        towel: The towel in it; None before it was found.
    """

    @checked
    def __init__(
        self, driver: Any, *, table: Table, rest_height: float = 0.0025, device: str = "auto",
    ) -> None:  # fmt: skip
        if not all(hasattr(driver, name) for name in ("robot", "update_robot_state", "angle_vector")):
            raise InvalidInputError(f"driver must have a robot's interface, got {type(driver).__name__}")
        if table.half_extents is None or table.centre is None:
            raise InvalidInputError("the robot must know where its table ends")
        self.driver, self.table, self.rest_height = driver, table, rest_height
        self.world = World(device=device)
        self.world.add(plane(name="floor", color="#b9b2a6"))
        size = (2.0 * table.half_extents[0], 2.0 * table.half_extents[1], table.thickness)
        place = (*table.centre, table.height - 0.5 * table.thickness)
        self.world.add(box(size, name="table", color="#a9825a", position=place))
        self._margin = box(tuple(side + 2.0 * CLEARANCE for side in size), name="table", position=place)
        driver.update_robot_state()
        self.robot: Humanoid = driver.robot.copy()
        self.links: Links = self.robot.enter(self.world)
        self._own = (*self.links.bodies, *put_beads(self.links))
        self.cameras = HeadCameras(self.links, STEREO)
        self.towel: Body | None = None
        self.rectangle: ClothRectangle | None = None
        self._before: Look | None = None
        self._mask: np.ndarray | None = None
        self._hand = ""

    # Looking

    def look_down(self) -> None:
        """Lean forward and look at the table."""
        self.driver.angle_vector(LEAN, 2.0)
        self.driver.wait_interpolation()

    def look(self) -> Look:
        """Look, and note where the robot itself is."""
        self.driver.angle_vector()
        self.robot.take_configuration(self.driver.robot.configuration())
        self.links.follow(0.0)
        images = {name: seen.image for name, seen in self.driver.read_images(STEREO).items()}
        thought = self.cameras.look()
        return Look(
            images, {name: self.cameras.camera(name) for name in STEREO},
            {name: grow(picture.mask(*self._own), RIM) for name, picture in thought.items()},
        )  # fmt: skip

    def find_towel(self) -> Body:
        """Look for the towel on the table, and put it into the robot's world, where it lies still.

        Raises:
            ClothNotFoundError: nothing lies on the table.
            EstimationError: it is no rectangle.
        """
        self._before = seen = self.look()
        image, camera = seen.images[STEREO[0]], seen.cameras[STEREO[0]]
        self._mask = segment_before(image, camera, self.table) & ~seen.own[STEREO[0]]
        found = fit_rectangle(self._mask, image, camera, self.table.height + self.rest_height)
        self.rectangle = found
        color = tuple(image[self._mask].mean(axis=0) / 255.0)
        towel = sheet((found.long_m, found.short_m), CELLS, name="towel", position=found.centre, color=color)
        towel.rotate(found.yaw, "z", wrt="world")
        self.towel = self.world.add(towel)
        return self.towel

    # Picking

    def point(self, i: int, j: int, grid: tuple[int, int] = (6, 6)) -> np.ndarray:
        """Return where a point of the grid on the towel is (3,) [m], by what was found.

        Raises:
            EstimationError: the towel has not been found.
        """
        return self._found()[1].grid_points(*grid)[i, j]

    def pick(self, point: np.ndarray) -> str:
        """Take the towel as cloth, pinch it at a point (3,) [m], lift it into view, and let it come to rest.

        Returns:
            The hand that did.

        Raises:
            EstimationError: the towel has not been found, or the hand does not get there.
        """
        towel = self._found()[0]
        hand = self._hand = "left_hand" if point[1] >= 0.0 else "right_hand"
        arm = ARMS[hand]
        self.world.attach(towel)
        above = point + np.array([0.0, 0.0, ABOVE])
        self._approach(hand, above)
        self.driver.move_gripper(arm, OPENING)
        self._go(hand, _straight(above, point), APPROACH_SECONDS)
        self.driver.start_grasp(arm)
        x, y, height = SHOWN[hand]
        shown = np.array([x, y, self.table.height + self.rest_height + height])
        self._go(hand, _straight(point, shown), LIFT_SECONDS)
        self.driver.sleep(REST_SECONDS)
        return hand

    def _approach(self, hand: str, point: np.ndarray) -> None:
        """Bring what is between the fingers to a point (3,) [m] from anywhere, with the arm alone, past the table.

        Raises:
            EstimationError: the hand does not reach it, or no way there is free.
        """
        limb, columns = self._arm(hand)
        begin = self.robot.angle_vector()
        end = self._reached(hand, columns, point, attempts=10)  # from anywhere
        near = Obstacles(self.robot, [self._margin], {column + 2 for column in columns})

        def problem(angles: np.ndarray) -> str:
            self.robot.angle_vector(angles)
            met = near.met(self.robot.configuration())
            return "" if met is None else f"{met[0]} comes within {1000.0 * CLEARANCE:.0f} mm of the table"

        try:
            way = free_way(begin, end, columns, self.robot.joint_limits, problem, f"the {hand} cannot go to the towel")
        except ReachError as error:
            raise EstimationError(str(error)) from error
        turns = np.abs(np.diff(np.stack([begin, *way]), axis=0)).max(axis=1)
        for angles, turn in zip(way, turns, strict=True):  # one by one, as only straight lines were looked at
            self._send(limb, columns, [angles], float(APPROACH_SECONDS * turn / max(turns.sum(), 1e-9)))

    def _go(self, hand: str, points: list[np.ndarray], seconds: float) -> None:
        """Bring what is between the fingers along points (3,) [m], at even times, with the arm alone.

        Raises:
            EstimationError: the hand does not get there.
        """
        limb, columns = self._arm(hand)
        # an arm on a straight way must not turn over
        self._send(limb, columns, [self._reached(hand, columns, point, attempts=2) for point in points], seconds)

    def _arm(self, hand: str) -> tuple[str, list[int]]:
        """Read where the robot is, and return the controller of a hand's arm and the indices of its joints."""
        self.driver.angle_vector()
        self.robot.take_configuration(self.driver.robot.configuration())
        limb = f"{ARMS[hand]}_controller"
        names = next(
            group["joint_names"] for group in self.driver.default_controller() if group["controller_type"] == limb
        )
        return limb, [self.robot.joint_index(name) for name in names]

    def _reached(self, hand: str, columns: list[int], point: np.ndarray, attempts: int) -> np.ndarray:
        """Return angles [rad] with what is between the fingers at a point (3,) [m], and take them."""
        kept = self.robot.angle_vector()
        reached = self.robot.reach({hand: pinching(hand, point)}, stance=TRUNK, attempts=attempts)
        if not reached:
            raise EstimationError(f"the {hand} does not reach {np.round(point, 3).tolist()} m: {reached.reason}")
        kept[columns] = self.robot.angle_vector()[columns]
        return self.robot.angle_vector(kept)

    def _send(self, limb: str, columns: list[int], angles: list[np.ndarray], seconds: float) -> None:
        """Send an arm through angles [rad] at even times, and wait; raise where it does not get there."""
        self.driver.angle_vector_sequence(angles, [seconds / len(angles)] * len(angles), limb)
        self.driver.wait_interpolation()
        self.driver.angle_vector()
        off = np.abs(self.driver.robot.angle_vector() - angles[-1])[columns].max()
        if off > STOPPED:
            raise EstimationError(
                f"the {limb} stopped {off:.2f} rad before it got there; the driver's warnings say what it met"
            )

    # Telling

    def answer(self, **options: Any) -> Answer:
        """Look at the towel in the hand, and tell at which point it is held.

        Args:
            options: Of ``estimate_pick``. Whatever the point, the hand was led to one place, so nothing follows from
                how far sideways it went: ``sideways`` is None unless given.

        Raises:
            EstimationError: nothing has been picked, the bead on the hand is not seen, or nothing explains the image.
        """
        _, rectangle, before = self._found()
        if not self._hand:
            raise EstimationError("the towel has not been picked yet; call pick first")
        after = self.look()
        left = STEREO[0]
        held, deviation = self.see_hand(after)
        result = estimate_pick(
            before.images[left], after.images[left], camera=after.cameras[left], table_height=self.table.height,
            table_half_extents=self.table.half_extents, table_centre=self.table.centre,
            table_thickness=self.table.thickness, hand=held, rest_height=self.rest_height, rectangle=rectangle,
            before_mask=self._mask, hidden=after.own[left], lift_seconds=LIFT_SECONDS, device=self.world.device,
            **{"sideways": None, **options},
        )  # fmt: skip
        by_joints = self.robot.frame_pose(self._hand).to_world([PINCH])[0]
        i, j = result.best
        return Answer((int(i), int(j)), result, held, deviation, by_joints, before, after)

    def believe(self, answer: Answer) -> Body:
        """Let the towel in the robot's world hang as the answer says, and return it.

        It is picked there at the answer's point, as the most likely cloth, and comes to rest in the hand.

        Raises:
            EstimationError: the towel has not been found.
        """
        towel, world = self._found()[0], self.world
        futures = answer.result.futures
        likely = futures.discretisation.hypotheses[answer.result.best_index // futures.candidates]
        for body in self._own:  # the hand is there already, before the towel comes up to it
            world.ignore_contact(towel, body)
        material = Cloth(
            area_density=likely.area_density, stretch_stiffness=likely.stretch_stiffness,
            shear_stiffness=likely.shear_stiffness, bending_rigidity=likely.bending_rigidity,
            thickness=likely.thickness or 2.0 * self.rest_height, friction=likely.friction, air_drag=likely.air_drag,
        )  # fmt: skip
        world.find("table").friction = likely.friction
        world.set_material(towel, material)
        start = self.point(*answer.pick)
        times = np.array([world.time, world.time + LIFT_SECONDS])
        way = Path(times, np.stack([start, answer.held]), interpolation="minimum_jerk")
        world.grip(towel, towel.closest(start), to=way)
        world.run(LIFT_SECONDS + REST_SECONDS, progress=False)
        return towel

    def see_hand(self, seen: Look) -> tuple[np.ndarray, float]:
        """Return where the held point is (3,) [m], by the bead in both images, and its standard deviation [m].

        How the hand is turned, which takes the bead's place to that of the fingers, is by the joints' readings.
        """
        pose = self.robot.frame_pose(self._hand)
        expected = pose.to_world([BEAD_AT])[0]
        pixels = [find_bead(seen.images[name], seen.cameras[name], expected) for name in STEREO]
        bead = triangulate(seen.cameras[STEREO[0]], seen.cameras[STEREO[1]], *pixels)
        held = bead.positions[0] + pose.rotation @ (np.array(PINCH) - BEAD_AT)
        return held, float(bead.deviations[0])

    def _found(self) -> tuple[Body, ClothRectangle, Look]:
        if self.towel is None or self.rectangle is None or self._before is None:
            raise EstimationError("the towel has not been found yet; call find_towel first")
        return self.towel, self.rectangle, self._before


def pinching(hand: str, point: np.ndarray) -> Coordinates:
    """Return where a hand is that pinches a cloth at a point (3,) [m]."""
    pose = Coordinates(quaternion=DOWN).rotate(-SLANT, "y", wrt="world").rotate(TOWARDS[hand], "z", wrt="world")
    return pose.locate(point - pose.rotation @ PINCH)


def _straight(start: np.ndarray, end: np.ndarray) -> list[np.ndarray]:
    """Points at even times on a straight way of minimum jerk, without its start."""
    s = np.arange(1, PIECES + 1) / PIECES
    return list(start + minimum_jerk(s)[:, None] * (end - start))
