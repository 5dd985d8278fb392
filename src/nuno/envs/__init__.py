"""Learning environments with cloth, in Gymnasium's interface (the extra ``envs``)."""

from nuno.envs.cloth_task import ClothTask, Start, Waypoint
from nuno.envs.cover_task import CoverTask
from nuno.envs.fold_task import FoldTask
from nuno.envs.gymnasium_package import gymnasium
from nuno.envs.hang_task import HangTask
from nuno.envs.scripted_policy import ScriptedPolicy
from nuno.envs.single_env import ClothEnv
from nuno.envs.spread_task import SpreadTask
from nuno.envs.tasks import TASKS
from nuno.envs.top_view import TopView
from nuno.envs.vector_env import ClothVectorEnv

__all__ = [
    "TASKS",
    "ClothEnv",
    "ClothTask",
    "ClothVectorEnv",
    "CoverTask",
    "FoldTask",
    "HangTask",
    "ScriptedPolicy",
    "SpreadTask",
    "Start",
    "TopView",
    "Waypoint",
]

for _name in TASKS:
    gymnasium.register(
        id=f"nuno/{_name.capitalize()}-v0",
        entry_point="nuno.envs:ClothEnv",
        vector_entry_point="nuno.envs:ClothVectorEnv",
        kwargs={"task": _name},
    )
