"""AprilTags on the walls as a plug-in, ``--fiducials N``; the distances between the tags serve to score the map."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import tyro

from pipeline.arrays import Poses
from pipeline.errors import InputError
from pipeline.plugin import Plugin, RunContext
from pipeline.sink import Sink
from sarsim.plugins.fiducials.score import FiducialScore
from sarsim.plugins.fiducials.tags import hang_fiducials
from sarsim.settings import SimulatorConfig


@dataclass(frozen=True)
class FiducialsConfig:
    """Settings of the tags on the walls.

    Attributes:
        number: number of tags.
    """

    number: Annotated[int, tyro.conf.Positional]


class Fiducials(Plugin):
    """Hangs tags on the walls of a simulated arena, and uses the tags to score the map."""

    Settings = FiducialsConfig

    def __init__(self, settings: FiducialsConfig, command: Any) -> None:
        super().__init__(settings, command)
        if not isinstance(command, SimulatorConfig):
            raise InputError(
                f"--fiducials {settings.number}: only episodes and sarsim-ros-robot have these tags; leave it out"
            )
        self._T_world_tag: Poses = np.zeros((0, 4, 4))

    def add_to_arena(self, arena: Any) -> None:
        """Hang the tags; InputError if there is no room."""
        self._T_world_tag = hang_fiducials(arena, self.settings.number, self.command.seed)

    def sinks(self, context: RunContext) -> Sequence[Sink]:
        """The sink that scores the map; none if there are no tags."""
        return [FiducialScore(self._T_world_tag, context.mapper.keyframes)] if len(self._T_world_tag) else []
