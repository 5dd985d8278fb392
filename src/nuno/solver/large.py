"""The plan for scenes too large for a block: a launch per phase and colour, captured once as a graph."""

from typing import Any

import warp as wp


class LargePlan:
    """Placeholder until the phases are split."""

    def __init__(self, *args: Any) -> None:
        raise NotImplementedError
