"""The tasks by name."""

from __future__ import annotations

from typing import Any

from nuno.envs.cloth_task import ClothTask
from nuno.envs.cover_task import CoverTask
from nuno.envs.fold_task import FoldTask
from nuno.envs.hang_task import HangTask
from nuno.envs.spread_task import SpreadTask
from nuno.errors import InvalidInputError, UnknownNameError

TASKS: dict[str, type[ClothTask]] = {task.name: task for task in (SpreadTask, FoldTask, HangTask, CoverTask)}

OPTIONS = ("cells", "substeps", "device", "material")


def make_task(task: str | ClothTask, **options: Any) -> ClothTask:
    """Return a task by its name, with options; one that is a task already has its own.

    Raises:
        UnknownNameError: there is no such task.
        InvalidInputError: options beside a task, or neither a task nor a name.
    """
    if isinstance(task, ClothTask):
        if options:
            raise InvalidInputError(f"{', '.join(options)}: the task that was given has its own options")
        return task
    if not isinstance(task, str):
        raise InvalidInputError(f"task must be a name or a ClothTask, got {type(task).__name__}")
    if task not in TASKS:
        raise UnknownNameError("task", task, list(TASKS))
    unknown = sorted(set(options) - set(OPTIONS))
    if unknown:
        raise InvalidInputError(f"a task has no option {', '.join(unknown)}; it has {', '.join(OPTIONS)}")
    return TASKS[task](**options)
