"""Frames of rigid bodies that joints, ties or holds join, with no cloth among them: worlds part by part on the CPU.

Nothing is asked between the phases of such substeps but whether a list of contacts is too short. So a thread takes a
part of the worlds through a whole frame, and all threads wait for each other once a frame, not once a phase.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from nuno.coupled.coupled_passes import end_contacts, solve
from nuno.coupled.joint_closing import close_joints
from nuno.plans.cpu_threads import run_together
from nuno.plans.recorded_launches import RecordedLaunches, parts_of
from nuno.rigid.persistent_manifolds import LEFT, OVERFLOW
from nuno.rigid.rigid_substep import RigidSettings, run_rigid
from nuno.solvers.rigid_solver import PHASES, RigidSolver


@dataclass(eq=False)
class _Part:
    """A part of the worlds on its way through a frame.

    Attributes:
        worlds: The first, and the first after the part.
        counts: Of its worlds, of `RigidSolver.counts`.
        substeps: The launches of each substep: the prediction, which comes again where a row was too short, and others.
        done: How many substeps it has been through.
        stopped: Whether a row was too short in the prediction of the next.
    """

    worlds: tuple[int, int]
    counts: Any = None
    substeps: Sequence[tuple[Callable[[], Any], ...]] = ()
    done: int = 0
    stopped: bool = False

    def go_on(self) -> None:
        """Go through the substeps that are left, as far as no row is too short."""
        for predict, *others in self.substeps[self.done :]:
            if not self.stopped:  # else some of the worlds have moved already
                self.counts[:, LEFT] = 1
            self.counts[:, OVERFLOW] = 0
            predict()
            self.stopped = bool(self.counts[:, OVERFLOW].any())
            if self.stopped:
                return
            for launch in others:
                self.counts[:, LEFT] = 1  # which the phases of rigid bodies count down
                launch()
            self.done += 1


class RigidParts:
    """Launches of the frames of a group of rigid bodies.

    Args:
        launches: Those of the group.
    """

    def __init__(self, launches: RecordedLaunches) -> None:
        self._launches = launches
        # one for the first substep of a frame, in which impulses are summed anew, and one for the others
        self._settings = RigidSettings(), RigidSettings()

    def run_frame(
        self, rigid: RigidSolver, dt: float, substeps: int, joined: Callable[[float], Sequence[Any]] | None,
        contacts: Callable[[], Sequence[Any]], closed: Callable[[], Sequence[Any]] | None,
    ) -> None:  # fmt: skip
        """Go through the substeps of a frame.

        Args:
            rigid: The rigid solver, opened.
            dt: Of a substep [s].
            substeps: Their number.
            joined: Returns what `solve` takes where so much of the frame is over; None where nothing is joined.
            contacts: Returns what `end_contacts` takes.
            closed: Returns what `close_joints` takes; None where there are no joints.
        """
        for settings, frame in zip(self._settings, (1, 0), strict=True):
            rigid.write_settings(settings, dt, frame)
        left = [_Part(worlds) for worlds in parts_of(rigid.world_count)]
        while left:
            # what launches take is in other arrays once there is more room
            solved = [] if joined is None else [joined((k + 1) / substeps) for k in range(substeps)]
            for part in left:
                self._record(part, rigid, substeps, solved, contacts(), None if closed is None else closed())
            run_together([part.go_on for part in left])
            left = [part for part in left if part.stopped]
            if left:
                rigid.make_room()

    def _record(
        self, part: _Part, rigid: RigidSolver, substeps: int, solved: Sequence[Any], contacts: Sequence[Any],
        closed: Sequence[Any] | None,
    ) -> None:  # fmt: skip
        """Set the launches of a part."""

        def recorded(kernel: Any, inputs: Sequence[Any], name: Any) -> Callable[[], Any]:
            return self._launches.launch_of_part(kernel, part.worlds, 1, inputs, ("frame", name))

        def phase(name: str, first: bool) -> Callable[[], Any]:
            settings = self._settings[0 if first else 1]
            inputs = [rigid.state, rigid.table.parts, rigid.manifolds, rigid.rules, settings, PHASES[name], 1]
            return recorded(run_rigid, inputs, (name, first))

        predict = [phase("predict", k == 0) for k in range(min(2, substeps))]
        ends = [recorded(end_contacts, contacts, None), phase("finish", False)]
        if closed is not None:
            ends.append(recorded(close_joints, closed, None))
        solves = [[recorded(solve, inputs, k)] for k, inputs in enumerate(solved)] or [[]] * substeps
        part.counts = rigid.counts()[slice(*part.worlds)]
        part.substeps = [(predict[min(k, 1)], *own, *ends) for k, own in enumerate(solves)]
