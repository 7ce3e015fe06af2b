"""The achievements of an exploration so far, according to ground truth."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import required
from pipeline.explorer import Explorer
from pipeline.mapper import Keyframe, Mapper
from pipeline.rescue_report.figures import figures as flat
from pipeline.sink import Sink, Step
from pipeline.tracks.find import HEAT
from sarsim.scoring.coverage import Coverage
from sarsim.scoring.navigation import NavigationScore, navigation_figures
from sarsim.scoring.trajectory import is_tipped
from sarsim.scoring.victims import VictimScore
from sarsim.simulated_robot import SimulatedRobot

IN_VIEW = ("present", "visible")
"""Figures of people and objects that need no detector."""


class Achievements(Sink):
    """Measures the ground that an explorer sees, its finds and its driving."""

    def __init__(self, robot: SimulatedRobot, explorer: Explorer, finds: Sequence[Sink] = ()):
        """Measure ``robot``, at its start, driven by ``explorer``; ``finds`` score the objects besides people."""
        model, data = robot.physics.model.ptr, robot.physics.data.ptr
        self._robot, self._explorer, self._coverage = robot, explorer, Coverage(robot)
        self._navigation = NavigationScore(robot, self._coverage.surface)
        self._victims, self._finds = VictimScore(model, data), finds
        self._start, self._kidnaps, self._frontiers = robot.time, 0, 0

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Add the ground, people and objects that a keyframe shows."""
        truth = required(self._robot.true_frame)
        self._coverage.see(truth.points())
        self._victims.add(truth.image)
        for sink in self._finds:
            sink.on_keyframe(keyframe)

    def on_step(self, mapper: Mapper, step: Step) -> None:
        """Count kidnappings, and store the number of frontiers."""
        self._kidnaps += step.was_carried
        self._frontiers = len(step.frontiers)

    @property
    def seconds(self) -> float:
        """Simulated time since the start, s; the last known time if the simulation diverged and MuJoCo was reset."""
        return self._robot.trajectory[-1].time - self._start

    @property
    def totals(self) -> NDArray[np.float64]:
        """(4,) drivable ground seen, m²; time, s; number of people and objects found; number of contacts.

        Without a detector, all people and objects that have come into view are taken as found.
        """
        surface = self._coverage.surface
        ground = (self._coverage.seen & surface.drivable).sum() * surface.grid.cell**2
        wanted = "found" if self._explorer.mapper.detector else "visible"
        finds = sum(stage[wanted] for name, stage in self._found().items() if not name.endswith(HEAT))
        return np.array([ground, self.seconds, finds, self._robot.collisions.collisions], np.float64)

    @property
    def is_tipped(self) -> bool:
        """Whether the robot lies on its side or back."""
        return is_tipped(self._robot.trajectory[-1].T_world_base)

    def figures(self) -> dict[str, Any]:
        """Figures under their keys in report.json, except those without a value."""
        navigation = navigation_figures(self._explorer.pilot.navigator, self._navigation, self._kidnaps)
        seen = {"explored_fraction": self._coverage.fraction, "frontiers_left": self._frontiers}
        stages = {"navigation": navigation, "exploration": seen, **self._found()}
        named = [figure for stage, all in stages.items() for figure in flat(stage, all)]
        return {name: value for name, value in named if value is not None}

    def _found(self) -> dict[str, dict[str, Any]]:
        mapper = self._explorer.mapper
        positions = np.array([victim.position for victim in mapper.victims.confirmed]).reshape(-1, 3)
        found = {"victims": self._victims.report(positions)}
        for sink in self._finds:
            for stage, kinds in sink.figures().items():
                found |= {f"{stage}.{kind}": figures for kind, figures in kinds.items()}
        if mapper.detector:
            return found
        return {stage: {name: all[name] for name in IN_VIEW} for stage, all in found.items()}
