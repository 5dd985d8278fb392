"""A camera or a table's height that is told wrongly: what puts the table's border where it is seen is taken instead."""

from __future__ import annotations

from dataclasses import dataclass, replace

from nuno.camera.camera_of_table import corrected, view_of_table
from nuno.estimate.hand_error import poses_of
from nuno.estimate.pick_images import PickImages
from nuno.estimate.pick_settings import PickSettings


@dataclass(frozen=True)
class TableDoubt:
    """Settings as the table's border tells.

    Attributes:
        settings: With camera and table as they are taken.
        is_seen: Whether the border tells what is right: then no outline of a cloth need be asked.
        warnings: Of what is taken otherwise than it is told.
    """

    settings: PickSettings
    is_seen: bool = False
    warnings: tuple[str, ...] = ()


def with_view_of_table(settings: PickSettings, images: PickImages) -> TableDoubt:
    """Return settings with the camera and the table's height that its border in the image before tells.

    They stay as they are where the border does not tell that others are clearly right.

    Args:
        settings: As they are told.
        images: With the image before, or without.
    """
    if images.before is None:
        return TableDoubt(settings)
    view = view_of_table(images.before, settings.camera, settings.table)
    if view is None or view.warning is None:
        return TableDoubt(settings, view is not None)
    if not view.errors.any():
        return TableDoubt(settings, False, (view.warning,))
    camera, table = corrected(settings.camera, settings.table, view.errors)
    if settings.hand[2] < table.height:  # a hand below the table holds nothing
        return TableDoubt(settings)
    poses = poses_of(camera, settings.turns, settings.hand_std if settings.with_evidence else 0.0)
    return TableDoubt(replace(settings, camera=camera, table=table, poses=poses), True, (view.warning,))
