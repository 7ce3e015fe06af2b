"""The data that a run passes to its sinks: its steps, its events and its result."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.arrays import Places
from pipeline.elevation_map.traversability import Traversability
from pipeline.exploration.viewpoint import Context, Viewpoint
from pipeline.frame import Frame
from pipeline.keyframes import Moves
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.mapper import Keyframe, Mapper
from pipeline.planning.path_plan import PathPlan
from pipeline.robot import Motion
from pipeline.victims.detection import Detection


@dataclass(frozen=True, eq=False)
class Step:
    """The observations and decisions of a step.

    Attributes:
        number: number of the step, from 0.
        keyframe: the newest keyframe, with its labels, planes and detections.
        context: the data on which the decision was based.
        viewpoint: the next viewpoint; None if no viewpoint is left.
        plan: the path to the viewpoint.
        frontiers: (N, 3) m, centres of the remaining frontiers in ``map``.
        viewpoints_left: when exploration has ended, the viewpoints that would show more but are not worth the drive.
        explores: whether the task is to explore rather than to reach goals.
        end_reason: why exploration ends with this step: ``nothing_left``, ``not_worth_it``, ``unreachable``,
            ``held``, ``shut_in`` or ``time``; None if exploration continues or is not the task.
        can_drive: whether the robot can drive away from its position and is not held.
        was_carried: whether the robot has been carried elsewhere since the last step.
    """

    number: int
    keyframe: Keyframe
    context: Context
    viewpoint: Viewpoint | None
    plan: PathPlan | None
    frontiers: Places
    viewpoints_left: list[Viewpoint]
    explores: bool
    end_reason: str | None
    can_drive: bool
    was_carried: bool

    @property
    def traversability(self) -> Traversability:
        """Where the robot may drive."""
        return self.context.traversability


@dataclass
class Result:
    """The result of a run.

    Attributes:
        folder: where sinks write their files.
        mapper: holds all maps, corrected for the last time.
        trajectory: the estimated trajectory.
        steps: number of steps, or of labelled keyframes if sarsim does not drive; if 0, there is nothing to write.
        sim_time: duration of the run by the robot's clock, s.
        wall_time: wall time of the run, s.
        figures: figures of each stage for report.json.
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
        """Whether there is anything to report: at least one step, or the reason why there is none."""
        return self.steps > 0 or "lost" in self.figures

    def add(self, figures: Mapping[str, Any]) -> None:
        """Add figures of stages to the existing figures."""
        for stage, values in figures.items():
            before = self.figures.get(stage)
            self.figures[stage] = before | values if isinstance(before, dict) else values


class Sink:
    """Watches a run and receives its result; a subclass overrides the methods that it needs.

    Attributes:
        finishing: description of the work of :meth:`finish`, as text for the progress display.
    """

    finishing: str = "writing the results"

    def on_motion(self, motion: Motion) -> None:
        """Called when the robot has moved for a control period."""

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Called when a keyframe has been added to the maps, in a step or during a drive."""

    def on_detections(self, keyframe: int, frame: Frame, detections: list[Detection]) -> None:
        """Called when a keyframe's image has been searched for people, at the latest before the next keyframe."""

    def on_correction(self, moves: Moves) -> None:
        """Called when the maps have been rebuilt where keyframe poses were corrected."""

    def on_step(self, mapper: Mapper, step: Step) -> None:
        """Called when a step has been decided, before the drive."""

    def figures(self) -> dict[str, Any]:
        """The figures so far of each stage, for report.json."""
        return {}

    def finish(self, result: Result) -> None:
        """Called when the run has ended: write the remaining results. By default, the figures go to report.json."""
        if result.is_reported:
            result.add(self.figures())
