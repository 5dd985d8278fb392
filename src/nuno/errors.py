"""The errors that Nuno raises, all under one root.

Every message says what was received and what is valid; the data that a program may want stands in attributes.
"""

from __future__ import annotations

from difflib import get_close_matches


class NunoError(Exception):
    """Root of all errors that Nuno raises on purpose."""


class InvalidInputError(NunoError, ValueError):
    """A value that cannot be used: wrong shape, not finite, out of range."""


class UnknownNameError(NunoError, KeyError):
    """A name that is not there.

    Args:
        kind: What was looked for ("body", "material", ...).
        name: The name that was asked for.
        valid: The names that exist.
    """

    def __init__(self, kind: str, name: str, valid: list[str]) -> None:
        self.kind, self.name, self.valid = kind, name, sorted(valid)
        alike = get_close_matches(str(name), self.valid, n=1)
        hint = f" (did you mean {alike[0]!r}?)" if alike else ""
        super().__init__(f"no {kind} named {name!r}; there are: {', '.join(self.valid) or 'none'}{hint}")

    def __str__(self) -> str:
        return str(self.args[0])


class BodyStateError(NunoError, RuntimeError):
    """An action that the body's present state does not allow (attach twice, a grip on a static body ...)."""


class MeshError(InvalidInputError):
    """A mesh that cannot be used, with what is wrong and how to mend it."""


class MissingPackageError(NunoError, ImportError):
    """An optional package that is not installed.

    Args:
        package: Its name.
        extra: The extra of nuno-sim that brings it.
        purpose: What needs it.

    The command in the message is for a clone, as nuno-sim is on no package index yet.
    """

    def __init__(self, package: str, extra: str, purpose: str) -> None:
        self.package, self.extra = package, extra
        super().__init__(
            f"{purpose} needs {package}, which is not installed; in a clone of Nuno: "
            f"pip install -c constraints.txt '.[{extra}]'"
        )


class EngineCapabilityError(NunoError, RuntimeError):
    """Something that a world's engine cannot do; nothing has changed.

    Args:
        engine: The engine's name.
        capability: What it lacks, one of ``nuno.engines.engine.CAPABILITIES``.
        others: The names of the engines that have it.
        hint: What helps besides, or nothing.
    """

    def __init__(self, engine: str, capability: str, others: tuple[str, ...], hint: str = "") -> None:
        self.engine, self.capability, self.others = engine, capability, others
        have = f"engines that have: {', '.join(others) or 'none'}"
        super().__init__(f"{engine} has no {capability}; {have}{'; ' if hint else ''}{hint}")


class FileFormatError(NunoError, ValueError):
    """A file that Nuno cannot read: another format, a newer version, or damaged."""


class FileWriteError(NunoError, OSError):
    """A file that cannot be written: no such folder, a read-only one, a full disk; what was there is still whole.

    Args:
        message: What could not be written, and what helps.
        number: The system's number of the error (``errno``), where it has one.
    """

    def __init__(self, message: str, number: int | None = None) -> None:
        super().__init__(message)
        self.errno = number


class ImageError(InvalidInputError):
    """An image that cannot be read or does not fit its camera."""


class BoardNotFoundError(ImageError):
    """An image that does not show the calibration board, or the marker, that is looked for."""


class ImageQualityError(ImageError):
    """An image that is blurred, overexposed or too dark to measure in."""


class ClothNotFoundError(NunoError, RuntimeError):
    """No cloth was found in the image."""


class EstimationError(NunoError, RuntimeError):
    """Valid input for which no answer could be computed."""


class CalibrationError(EstimationError):
    """Images of a board from which no camera follows: too few, too much alike, or not those of one camera."""


class NotEnoughMemoryError(NunoError, MemoryError):
    """Something that needs more memory than is free; nothing was begun.

    Args:
        what: What needs it.
        needed: How much it needs [bytes].
        free: How much is free [bytes].
        hint: What helps.
    """

    def __init__(self, what: str, needed: int, free: int, hint: str) -> None:
        self.needed, self.free = int(needed), int(free)
        super().__init__(f"{what} would need {needed / 1e9:.3g} GB of memory, and {free / 1e9:.3g} GB are free: {hint}")


class SimulationDiverged(NunoError, RuntimeError):
    """A state that is no longer finite; the world keeps its last good state.

    Args:
        body: Name of the body.
        time: Simulated time [s] of the last good state.
        worlds: Which worlds of a batch; empty where that is not known.
    """

    def __init__(self, body: str, time: float, worlds: tuple[int, ...] = ()) -> None:
        self.body, self.time, self.worlds = body, time, worlds
        super().__init__(
            f"the state of {body!r} stopped being finite after t = {time:.4f} s; the world was left as it was "
            "at that time. Smaller steps (substeps=...), softer materials or slower grips help"
        )


class RobotModelError(InvalidInputError):
    """A robot that cannot be used for what is asked: a file that is not there, no legs to stand on ..."""


class WalkError(NunoError, RuntimeError):
    """A walk that the robot cannot do: it would fall, slip, or go beyond what its joints can.

    Args:
        message: What is in the way, and what helps.
        time: When, in the walk [s]; None where that is not known.
        measures: What was found of the walk (``WalkMeasures``), or None where none came about.
    """

    def __init__(self, message: str, time: float | None = None, measures: object = None) -> None:
        self.time, self.measures = time, measures
        super().__init__(message)


class ReachError(NunoError, RuntimeError):
    """A motion that a robot's arms cannot do: out of reach, or something is in the way.

    Args:
        message: What is in the way.
        position_errors: By frame [m], how near the search came; empty where that was not what kept it.
    """

    def __init__(self, message: str, position_errors: dict[str, float] | None = None) -> None:
        self.position_errors = position_errors or {}
        super().__init__(message)


class NotConnectedError(NunoError, ConnectionError):
    """A connection that cannot be made: nobody listens there, or the port is taken."""


class ConnectionLostError(NotConnectedError):
    """A connection that was there and has ended."""


class RobotTimeoutError(NunoError, TimeoutError, RuntimeError):
    """A robot that does not answer, or tell what is asked, in time."""


class RefusedError(NunoError, RuntimeError):
    """A robot does not do what it was asked for on the wire."""


class MessageError(InvalidInputError):
    """A message on the wire that is not understood.

    Args:
        message: What was received, and what is valid.
        identity: The id of the message, where it has one.
    """

    def __init__(self, message: str, identity: str | int | None = None) -> None:
        self.identity = identity
        super().__init__(message)


class ViewerError(NunoError, RuntimeError):
    """A viewer that cannot do what is asked: it is closed, or its port is taken."""


class ResultsInUseError(NunoError, RuntimeError):
    """A results file that another sweep is writing to."""


class ResultsMismatchError(NunoError, ValueError):
    """A results file of another sweep: another trial, other parameters."""


class WorkerLostError(NunoError, RuntimeError):
    """An executor whose workers died, and that cannot be made anew."""
