"""Carrying a mat: a humanoid walks with a mat across its arms, and which way of holding it keeps it steadiest.

The full search of Ueda, Ogura, Okada and Inaba ("Design and Implementation of Humanoid Programming System Powered by
Deformable Objects Simulation"), section 5.3: the distance between the arms, and where the hands are under the mat.
"""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from nuno.bodies.body import Body
from nuno.bodies.make_bodies import sheet, soft_box
from nuno.errors import InvalidInputError, RobotModelError
from nuno.materials import Cloth, Material, Soft
from nuno.search.sweep import sweep
from nuno.tasks.arm_tracks import ArmTracks
from nuno.tasks.carry_plan import key_times, make_plan, motion_along, plan_motions, track_arms
from nuno.tasks.carry_result import CarryResult, CarryTrial
from nuno.tasks.carry_trials import CarryTrials, check_trunk, make_room, mat_size
from nuno.validation import LONGEST_WAIT, checked, finite_array, number
from nuno.world.device import checked_device, found_device

if TYPE_CHECKING:
    from nuno.robot.humanoid import Humanoid

NAMES = ("arm_distance", "offset_x", "offset_y")
HOLDS = ("support", "grip")
MATS = ("soft", "cloth")
SIZE = (0.6, 0.4, 0.02)
"""[m] Of the paper's mat as it is read here: across the arms, along them, and how thick."""
DISTANCES = tuple(float(d) for d in np.linspace(0.22, 0.445, 10))
"""[m] Between the hands: from the least that Talos' grippers let to where no way holds the mat any more."""
CELLS, CLOTH_CELLS = (18, 12, 3), (24, 16)
WALK = (0.5, 0.0, 0.0)
"""Ahead [m], to the left [m], turned by [rad]: four steps of Talos."""
OFFSETS_X, OFFSETS_Y = (-0.04, 0.05, 0.14), (-0.12, 0.0, 0.12)
"""[m] From the mat's centre of gravity to the middle between the hands, ahead and to the left."""
HANDS_AT = {"talos": (0.5, 1.1), "g1": (0.32, 0.87)}
"""[m] How far ahead and how high hands are for level forearms, by robot."""
FOAM = Soft(density=60.0, youngs_modulus=5e3, poisson_ratio=0.25, friction=0.5, damping=0.0, air_drag=1.0)
FABRIC = Cloth(area_density=0.6, bending_rigidity=1e-3, thickness=0.004, friction=0.5)


@checked
def carry_mat(
    robot: Humanoid | str | ArmTracks = "talos", mat: Body | str = "soft", material: Material | None = None, *,
    hold: str = "support", arm_distances: ArrayLike = DISTANCES, offsets_x: ArrayLike = OFFSETS_X,
    offsets_y: ArrayLike = OFFSETS_Y, walk: ArrayLike = WALK, walks: Sequence[Any] | None = None,
    hands_at: tuple[float, float] | None = None, arms: str = "hulls", arm_friction: float = 0.5, settle: float = 1.5,
    seconds: float = 8.0, device: str = "auto", substeps: int | None = None,
    results: str | os.PathLike[str] | None = None, executor: Executor | None = None,
) -> CarryResult:  # fmt: skip
    """Let a humanoid walk with a mat on its arms, in all ways of holding it, and say how steadily it did.

    The mat lies across both arms, touched by them and nothing else, with Coulomb friction; in each trial the robot
    stands for ``settle`` seconds and then walks. F is the integral over the ``seconds`` from the start of the walk of
    ``|D - D0|``, where D is the mean of the mat's vertices less the humanoid's base and D0 is D as the walk starts (eq.
    (2) and (3) of the paper; docs/carrying.md says how they are read). A trial whose state stops being finite has
    failed, and says so.

    Args:
        robot: A humanoid, which is left as it was, or its name; or the tracks of one's arms, planned before (the plan
            of a result, or ``ArmTracks.load``), which say themselves what ``arm_distances``, ``walk``, ``walks``,
            ``hands_at``, ``arms``, ``settle`` and ``seconds`` would say: no robot model is needed then.
        mat: "soft" (0.6 x 0.4 x 0.02 m of tetrahedra, three layers of cells), "cloth" (0.6 x 0.4 m), or a sheet or soft
            body of one's own, whose longer side comes to lie across the arms.
        material: Of the mat; None is ``FOAM`` or ``FABRIC`` of this module.
        hold: "support": nothing is gripped; "grip": the hands hold the mat's edges, which they draw together to
            where they are.
        arm_distances: (n,) [m], between the hands.
        offsets_x: (n,) [m], from the mat's centre of gravity to the middle between the hands, ahead.
        offsets_y: (n,) [m], likewise to the left.
        walk: (3,), where the robot walks: ahead and to the left [m], and turned by [rad].
        walks: Walks made before, one for each distance; None plans them.
        hands_at: How far ahead of the soles and how high the hands are [m]; None is known of Talos and G1.
        arms: What the mat lies on: "hulls", the links' collision shapes, or the smallest "boxes" around them.
        arm_friction: Coulomb's coefficient of the arms; with the mat's by the geometric mean.
        settle: Seconds that the robot stands with the mat, which is let down onto its arms, before it walks.
        seconds: Seconds from the start of the walk to the end of the trial.
        device: As of ``World``.
        substeps: As of ``World``.
        results: A file (JSON lines) that finished trials are appended to, from which a run that was killed goes on;
            see ``nuno.sweep``.
        executor: Of processes, among which the walks are shared out; None plans them one after the other.

    Raises:
        InvalidInputError: another hold, a mat wider than the arms, one that reaches into the trunk, or a value that
            is not finite or out of range.
        RobotModelError: no legs, no two hands, or arms that do not reach.
        WalkError: the robot cannot walk there so.
    """
    begin = time.perf_counter()
    if hold not in HOLDS:
        raise InvalidInputError(f"hold must be one of {HOLDS}, got {hold!r}")
    carried, made_of = _mat(mat, material)
    ahead, aside = (
        finite_array(name, value, ("n",)) for name, value in (("offsets_x", offsets_x), ("offsets_y", offsets_y))
    )
    rubbing = number("arm_friction", arm_friction, low=0.0)
    found_device(checked_device(device))
    if executor is not None and not isinstance(executor, Executor):
        raise InvalidInputError(f"executor must be a concurrent.futures.Executor, got {type(executor).__name__}")
    if arms not in ("boxes", "hulls") or (walks is not None and not isinstance(walks, Sequence)):
        raise InvalidInputError(f"arms must be hulls or boxes, and walks a sequence, got {arms!r} and {walks!r}")
    if isinstance(robot, ArmTracks):
        carrier, tracks = None, robot
        _check_distances(carried, tracks.distances)
    else:
        carrier = _robot(robot)
        _check_width(carrier, carried, arm_distances, hands_at)
        tracks = plan_arms(
            carrier, arm_distances=arm_distances, walk=walk, walks=walks, hands_at=hands_at, arms=arms, settle=settle,
            seconds=seconds, executor=executor,
        )  # fmt: skip
    walking = time.perf_counter()
    distances = tracks.distances
    plan = make_plan(tracks, carried, made_of, hold=hold, arm_friction=rubbing)
    rows = list(itertools.product(distances.tolist(), ahead.tolist(), aside.tolist()))
    walk_of = np.repeat(np.arange(len(distances)), len(ahead) * len(aside))
    check_trunk(plan, walk_of, np.array(rows)[:, 1:])
    placed = time.perf_counter()
    room = make_room(plan, device, substeps)
    # of a batch that is killed nothing is recorded: so no more than the cores take at once, unless a device takes all
    batch_size = len(rows) if results is None or room.device != "cpu" else min(len(rows), 16 * (os.cpu_count() or 1))
    shared = {"carry": plan.digest(substeps)}
    found = sweep(
        CarryTrials(plan), [dict(zip(NAMES, row, strict=True)) | shared for row in rows], world=room, results=results,
        batch=batch_size,
    )  # fmt: skip
    trials = tuple(_trial(row, outcome) for row, outcome in zip(rows, found.trials, strict=True))
    spent = {"walks": walking - begin, "arms": placed - walking, "trials": time.perf_counter() - placed}
    return CarryResult(trials, plan, carrier, walk_of, substeps, device, spent)


def plan_arms(
    robot: Humanoid | str = "talos", *, arm_distances: ArrayLike = DISTANCES, walk: ArrayLike = WALK,
    walks: Sequence[Any] | None = None, hands_at: tuple[float, float] | None = None, arms: str = "hulls",
    settle: float = 1.5, seconds: float = 8.0, executor: Executor | None = None,
) -> ArmTracks:  # fmt: skip
    """Return where a humanoid's arms are along its walks, for ``carry_mat`` here or, from a file, elsewhere.

    Args and Raises: those of ``carry_mat``.
    """
    from nuno.tasks.arms import SHAPES, hands_level

    if arms not in SHAPES:
        raise InvalidInputError(f"arms must be one of {SHAPES}, got {arms!r}")
    carrier = _robot(robot)
    distances, goal = finite_array("arm_distances", arm_distances, ("n",)), finite_array("walk", walk, (3,))
    rest, span = (
        number("settle", settle, above=0.1, high=LONGEST_WAIT),
        number("seconds", seconds, above=0.1, high=LONGEST_WAIT),
    )
    place = _hands_at(carrier, hands_at)
    if walks is not None and len(walks) != len(distances):
        raise InvalidInputError(f"walks must be {len(distances)}, one for each arm distance, got {len(walks)}")
    kept = carrier.configuration()
    try:
        stances = [hands_level(carrier, float(distance), *place) for distance in distances]
        times = key_times(rest, span)
        if walks is None:
            motions = plan_motions(carrier, stances, goal, times, executor)
        else:
            motions = [motion_along(walk, times) for walk in walks]
        return track_arms(carrier, motions, distances, arms=arms, settle=rest, seconds=span)
    finally:
        carrier.take_configuration(kept)


def _trial(row: tuple[float, float, float], outcome: Any) -> CarryTrial:
    if outcome.error is not None:
        return CarryTrial(*row, None, None, outcome.error)
    value, failed_at = (float(outcome.values[name]) for name in ("value", "failed_at"))
    return CarryTrial(*row, _or_none(value), _or_none(failed_at), str(outcome.values["reason"]))


def _robot(robot: Any) -> Humanoid:
    from nuno.robot.humanoid import Humanoid

    return robot if isinstance(robot, Humanoid) else Humanoid(robot)


def _mat(mat: Any, material: Material | None) -> tuple[Body, Material]:
    if isinstance(mat, str):
        if mat not in MATS:
            raise InvalidInputError(f"mat must be one of {MATS} or a body, got {mat!r}")
        mat = soft_box(SIZE, cells=CELLS) if mat == "soft" else sheet(SIZE[:2], cells=CLOTH_CELLS)
    if not isinstance(mat, Body) or not (mat.shape.is_cloth or mat.shape.is_soft):
        got = mat.shape.kind if isinstance(mat, Body) else type(mat).__name__
        raise InvalidInputError(f"a mat is a cloth or a soft body, got a {got}")
    return mat, material if material is not None else FABRIC if mat.shape.is_cloth else FOAM


def _hands_at(robot: Humanoid, hands_at: Any) -> tuple[float, float]:
    if hands_at is None:
        if robot.name not in HANDS_AT:
            raise InvalidInputError(
                f"where {robot.name!r} has its hands when its forearms are level is not known; say it with "
                "hands_at=(ahead, height)"
            )
        return HANDS_AT[robot.name]
    ahead, height = finite_array("hands_at", hands_at, (2,))
    return float(ahead), float(height)


def _check_distances(mat: Body, distances: np.ndarray) -> float:
    """Return how wide a mat is [m]; raise where that is less than the arms are apart."""
    width = float(max(mat_size(mat.shape, False)[:2]))
    if distances.max() >= width:
        raise InvalidInputError(
            f"the mat is {width:.3f} m across and the arms are up to {distances.max():.3f} m apart: it cannot lie on "
            "both"
        )
    return width


def _check_width(robot: Humanoid, mat: Body, arm_distances: ArrayLike, hands_at: Any) -> None:
    """Raise where the mat is narrower than the arms are apart, or wider than they can be."""
    from nuno.tasks.arms import HANDS, hands_level

    width = _check_distances(mat, finite_array("arm_distances", arm_distances, ("n",)))
    place, kept = _hands_at(robot, hands_at), robot.configuration()
    try:
        hands_level(robot, width, *place)
    except RobotModelError as error:
        if not robot.description.feet or any(hand not in robot.description.frames for hand in HANDS):
            raise
        raise InvalidInputError(
            f"the mat is {width:.3f} m across, wider than the arms of {robot.name!r} can carry: {error}"
        ) from error
    finally:
        robot.take_configuration(kept)


def _or_none(value: float) -> float | None:
    return None if np.isnan(value) else float(value)
