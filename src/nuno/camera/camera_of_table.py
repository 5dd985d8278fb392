"""Camera and table height by which a table's border is where the image shows it.

A table whose extents are known is a rectangle of known size. Its sides in the image tell the focal length, how the
camera is turned, and the table's height: those are fitted to the lines found (`nuno.camera.border_lines`) by least
squares. All of them are off by a little as a rule, and so are the extents: ordinary errors, which nobody need correct.
What is looked for are mistakes: a focal length, a turn or a height that is wrong by far more, while the others are as
they are told. So for every set of mistakes the fit has wide priors for these and narrow ones for all else, and each
mistake has to make the sum of squares less by `CLEARLY` squared. The extents may be a mistake themselves, alone: then
camera and height are left as they are told.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from nuno.camera.border_lines import Line, SideLines, lines_near
from nuno.camera.camera import Camera
from nuno.camera.gauss_newton import least_squares
from nuno.camera.table import Table

WIDTH = 640
"""[px] Larger images are looked at in this width, which tells lines well enough."""
NOISE = 0.5
"""[px] Standard deviation of a line at either end: a real border is rounded, a lens not quite corrected. Rendered ones
are true to 0.1 px."""
ORDINARY = np.array([0.008, *[np.deg2rad(0.25)] * 3, 0.004, *[0.005] * 4])
"""Standard deviations of ordinary errors: logarithm of the focal length, turns about the camera's axes [rad], height
[m], the top's middle and half extents [m]."""
MISTAKE = np.array([0.1, *[np.deg2rad(2.5)] * 3, 0.03, *[0.02] * 4])
"""Standard deviations of mistakes, of the same."""
GROUPS = {"focal": slice(0, 1), "turn": slice(1, 4), "height": slice(4, 5), "extents": slice(5, 9)}
"""Which numbers are one mistake."""
CAMERA = ("focal", "turn", "height")
"""Mistakes that may come together, and are set right."""
CLEARLY = 3.5
"""Standard deviations by which a mistake has to be clear."""
ELSE = 2.0
"""The same by which it must be clearer than any other."""
UNUSED = 9.0
"""Sum of squares of a side that shows no line that fits: less than a mistake needs, so that no other edge that is taken
for one side makes a mistake."""
GOOD = 20.0
"""Sum of squares beyond which the lines are no table's, whatever is wrong; eight distances and nine numbers are in
it."""
BORDER = "the table's border is where the image shows it only with "
"""How a warning begins of a mistake that is clear."""
BORDER_UNCLEAR = "the table's border is not where it is told to be, and the image does not tell which mistake it is"
"""How one begins of a mistake that may be another as well."""
MINIMUM_SIDES = 3
"""So many sides have to be seen."""
LINEAR_NOISE = 4.0
"""[`NOISE`] of linear fits, which choose lines."""
CHOICES = 2
"""Of lines are fitted, of those that are likeliest without a mistake, with those of the camera, and of the extents."""

SideLine = tuple[int, SideLines, Line]
"""The number of a side, the lines near it, and one of them."""
Chosen = list[SideLine]


@dataclass(frozen=True, eq=False)
class TableView:
    """The mistakes that a table's border in an image shows in how camera and height are told.

    Attributes:
        mistakes: Names out of `GROUPS`.
        errors: (5,) float: logarithm of the ratio of the true focal length to the one told, turns about the camera's
            axes [rad], how much higher the table is [m]; 0 where there is no mistake, or it may be the extents'.
        is_clear: Whether no other mistakes explain the image about as well.
        sides: How many sides were seen.
    """

    mistakes: tuple[str, ...]
    errors: np.ndarray
    is_clear: bool
    sides: int

    @property
    def warning(self) -> str | None:
        """Words of warning, where there is a mistake."""
        if not self.mistakes:
            return None
        are_right = "are the camera, table_height and the table's extents right?"
        if not self.errors.any():
            begins = f"{BORDER}other extents than are told" if self.is_clear else BORDER_UNCLEAR
            return f"{begins}; the camera is taken as it is told: {are_right}"
        share, turn, height = np.expm1(self.errors[0]), np.linalg.norm(self.errors[1:4]), self.errors[4]
        words = {
            "focal": f"a focal length that is {100.0 * abs(share):.0f} % {'longer' if share > 0.0 else 'shorter'}",
            "turn": f"a camera that is turned by {np.rad2deg(turn):.1f} degrees",
            "height": f"a table that is {100.0 * abs(height):.1f} cm {'higher' if height > 0.0 else 'lower'}",
        }
        taken = " and ".join(words[name] for name in self.mistakes)
        if self.is_clear:
            return f"{BORDER}{taken}, which is taken: {are_right}"
        return f"{BORDER_UNCLEAR}; {taken}, is taken: {are_right}"


def view_of_table(image: np.ndarray, camera: Camera, table: Table) -> TableView | None:
    """Return what a table's border tells; None where that is not known, too little seen, or explained by no mistake.

    Args:
        image: (h, w, 3) uint8.
        camera: As it is told.
        table: As it is told.
    """
    if table.half_extents is None:
        return None
    if camera.distortion is not None:
        image = cv2.undistort(image, camera.matrix, camera.distortion)
        camera = replace(camera, distortion=None)
    if camera.width > WIDTH:
        camera = camera.scaled(WIDTH / camera.width)
        image = cv2.resize(image, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    soft = cv2.GaussianBlur(image.astype(np.float32), (0, 0), 0.7)
    corners = border(table)
    sides = [
        (k, side)
        for k in range(4)
        if (side := lines_near(soft, corners[k], corners[(k + 1) % 4], camera)) is not None and side.lines
    ]
    if len(sides) < MINIMUM_SIDES:
        return None
    fits: list[tuple[float, tuple[str, ...], np.ndarray, int]] = []

    def fit(names: tuple[str, ...], among: Sequence[Chosen]) -> list[float]:
        costs = []
        for chosen in among:
            cost, errors = _fit(chosen, names, camera, table)
            costs.append(cost + UNUSED * (len(sides) - len(chosen)))
            fits.append((costs[-1] + CLEARLY**2 * len(names), names, errors, len(chosen)))
        return costs

    choices = _likely(sides, camera, table)
    if min(fit((), choices)) >= CLEARLY**2:  # else no mistake can be clear
        costs = np.array(fit(CAMERA, choices))
        good = [chosen for chosen, cost in zip(choices, costs, strict=True) if cost < costs.min() + UNUSED]
        for names in (*itertools.combinations(CAMERA, 1), *itertools.combinations(CAMERA, 2)):
            fit(names, good)
        fit(("extents",), choices)
    best, names, errors, count = min(fits, key=lambda fit: fit[0])
    if best - CLEARLY**2 * len(names) > GOOD:
        return None
    others = {other: cost for cost, other, *_ in sorted(fits, key=lambda fit: -fit[0])}
    close = [n for n in others if n and not set(n) >= set(names) and others[n] <= best + ELSE**2] if names else []
    taken = np.zeros(5)
    for name in () if ("extents",) in close else names:
        if name in CAMERA:
            taken[GROUPS[name]] = errors[GROUPS[name]]
    return TableView(names, taken, not close, count)


def _deviations(names: Sequence[str]) -> np.ndarray:
    """(9,) float, standard deviations of all numbers where these are mistakes."""
    deviations = ORDINARY.copy()
    for name in names:
        deviations[GROUPS[name]] = MISTAKE[GROUPS[name]]
    return deviations


def _residuals(numbers: np.ndarray, chosen: Chosen, camera: Camera, table: Table) -> np.ndarray:
    """(2 n,) float, how far the ends of lines are from where the numbers (9,) put the sides [standard deviations]."""
    camera, table = corrected(camera, table, numbers[:5])
    assert table.half_extents is not None
    middle = np.asarray(table.centre or (0.0, 0.0)) + numbers[5:7]
    half = np.asarray(table.half_extents) + numbers[7:9]
    corners = _corners(middle, np.maximum(half, 1e-3), table.height)
    found = []
    for k, side, line in chosen:
        begin, end = corners[k], corners[(k + 1) % 4]
        a, b = camera.project(begin + side.shares[:, None] * (end - begin))
        along = (b - a) / max(float(np.linalg.norm(b - a)), 1e-9)
        off = line.ends - a
        found.append((along[0] * off[:, 1] - along[1] * off[:, 0]) / NOISE)
    return np.nan_to_num(np.concatenate(found), nan=1e3)


def _fit(chosen: Chosen, names: Sequence[str], camera: Camera, table: Table) -> tuple[float, np.ndarray]:
    """The sum of squares of the best fit where these are mistakes, and its numbers (9,)."""
    deviations = _deviations(names)

    def all_of(scaled: np.ndarray) -> np.ndarray:
        return np.concatenate([_residuals(deviations * scaled, chosen, camera, table), scaled])

    scaled, cost = least_squares(all_of, np.zeros(9))
    return cost, deviations * scaled


def _likely(sides: Sequence[tuple[int, SideLines]], camera: Camera, table: Table) -> list[Chosen]:
    """Choices of one line for each side, or none, that fit together best, with mistakes and without; by linear fits."""
    priors = [np.diag((MISTAKE / _deviations(names)) ** 2) for names in ((), CAMERA, ("extents",))]
    options = []
    for k, side in sides:
        of: list[tuple[SideLine | None, np.ndarray, np.ndarray]] = []
        for line in side.lines:
            one = [(k, side, line)]
            here = _residuals(np.zeros(9), one, camera, table)
            step = 1e-4 * np.eye(9) * MISTAKE
            jacobian = np.stack([(_residuals(s, one, camera, table) - here) / 1e-4 for s in step], axis=1)
            of.append(((k, side, line), here / LINEAR_NOISE, jacobian / LINEAR_NOISE))
        options.append([*of, (None, np.zeros(2), np.zeros((2, 9)))])
    ranked: list[tuple[list[float], Chosen]] = []
    for choice in itertools.product(*options):
        chosen = [line for line, *_ in choice if line is not None]
        if len(chosen) < MINIMUM_SIDES:
            continue
        here, jacobian = (np.concatenate([part[n] for part in choice]) for n in (1, 2))
        unused = UNUSED * (len(sides) - len(chosen))
        costs = []
        for prior in priors:
            step = np.linalg.solve(jacobian.T @ jacobian + prior, -jacobian.T @ here)
            costs.append(float(((here + jacobian @ step) ** 2).sum() + step @ prior @ step) + unused)
        ranked.append((costs, chosen))
    best: list[Chosen] = []
    for n in range(len(priors)):
        for _, chosen in sorted(ranked, key=lambda entry: entry[0][n])[:CHOICES]:
            if not any(chosen is other for other in best):
                best.append(chosen)
    return best


def corrected(camera: Camera, table: Table, errors: np.ndarray) -> tuple[Camera, Table]:
    """Return camera and table with the errors (5,) taken away, see `TableView`."""
    pose = camera.camera_to_world.copy()
    pose[:3, :3] = pose[:3, :3] @ cv2.Rodrigues(np.asarray(errors[1:4], dtype=float))[0]
    ratio = float(np.exp(errors[0]))
    camera = replace(camera, fx=camera.fx * ratio, fy=camera.fy * ratio, camera_to_world=pose)
    return camera, replace(table, height=table.height + float(errors[4]))


def border(table: Table) -> np.ndarray:
    """(4, 3) float, the corners of a table's top [m], around it."""
    assert table.half_extents is not None
    return _corners(np.asarray(table.centre or (0.0, 0.0)), np.asarray(table.half_extents), table.height)


def _corners(middle: np.ndarray, half: np.ndarray, height: float) -> np.ndarray:
    """(4, 3) float, the corners of a top of half sizes (2,) about a middle (2,) [m]."""
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return np.column_stack([middle + signs * half, np.full(4, height)])
