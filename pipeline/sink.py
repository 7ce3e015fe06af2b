"""What a run hands to those who watch it: its steps, its events, and its result."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.arrays import Places
from pipeline.elevation_map.traversability import Traversability
from pipeline.exploration.viewpoint import Context, Viewpoint
from pipeline.keyframes import Moves
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.mapper import Keyframe, Mapper
from pipeline.planning.path_plan import PathPlan
from pipeline.robot import Motion


@dataclass(frozen=True, eq=False)
class Step:
    """What a step has found out and decided.

    Attributes:
        number: of the step, from 0.
        keyframe: what was sensed, with its labels, planes and detections.
        context: what the decision was based on.
        viewpoint: where to go next; None if no viewpoint is left.
        plan: the way to the viewpoint.
        frontiers: (N, 3) centres of the frontiers left.
        left: when exploring has ended, viewpoints that would show more but are not worth the drive.
        explores: whether the task is to explore, rather than to reach goals.
        ended: why exploring ends with this step: ``nothing_left``, ``not_worth_it``, ``held``, ``shut_in`` or
            ``time``; None if it goes on, or is not the task.
        can_drive: whether the robot stands where it can drive and is not held.
        was_carried: whether the robot was carried elsewhere since the last step.
    """

    number: int
    keyframe: Keyframe
    context: Context
    viewpoint: Viewpoint | None
    plan: PathPlan | None
    frontiers: Places
    left: list[Viewpoint]
    explores: bool
    ended: str | None
    can_drive: bool
    was_carried: bool

    @property
    def traversability(self) -> Traversability:
        """Where the robot may drive."""
        return self.context.traversability


@dataclass
class Result:
    """The end of a run.

    Attributes:
        folder: for files.
        mapper: with all maps, corrected for the last time.
        trajectory: the estimated one.
        steps: number of steps, or of labelled keyframes if nobody decides; with none, there is nothing to write.
        sim_time: s of the robot's time that the run took.
        wall_time: s that it took.
        figures: of each stage, for report.json.
        report: the content of report.json, once it is written.
    """

    folder: Path
    mapper: Mapper
    trajectory: EstimatedTrajectory[Any]
    steps: int
    sim_time: float
    wall_time: float
    figures: dict[str, Any] = field(default_factory=dict)
    report: dict[str, Any] = field(default_factory=dict)

    @property
    def is_reported(self) -> bool:
        """Whether there is anything to report: a step, or why there is none."""
        return self.steps > 0 or "lost" in self.figures

    def add(self, figures: Mapping[str, Any]) -> None:
        """Add the figures of stages to those that there are."""
        for stage, values in figures.items():
            before = self.figures.get(stage)
            self.figures[stage] = before | values if isinstance(before, dict) else values


class Sink:
    """Watches a run and takes its result; what a subclass does not override, it ignores.

    Attributes:
        finishing: what :meth:`finish` does, for those who watch the run's progress.
    """

    finishing: str = "writing the results"

    def on_motion(self, motion: Motion) -> None:
        """The robot has moved for a control period."""

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """A keyframe is in the maps, in a step or on the way."""

    def on_correction(self, moves: Moves) -> None:
        """The maps were made anew where the poses of their keyframes were corrected."""

    def on_step(self, mapper: Mapper, step: Step) -> None:
        """A step is decided; the drive is yet to come."""

    def finish(self, result: Result) -> None:
        """The run has ended; write what is left."""
