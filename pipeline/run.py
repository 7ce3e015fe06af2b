"""A run: a mapper, the sinks that watch it, an explorer that may drive, and the result."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pipeline.exploration.deadline import TimeIsUpError
from pipeline.exploration.viewpoint import Viewpoint
from pipeline.explorer import Explorer
from pipeline.files import run_all, uninterrupted
from pipeline.localisation.localisation import LostError
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.mapper import Keyframe, Mapper
from pipeline.navigation.commands import Outcome
from pipeline.planning.path_plan import place_name
from pipeline.plugin import Plugin
from pipeline.progress import Progress
from pipeline.rerun.recorder import Level, Recorder
from pipeline.rescue_report.report import RescueReport
from pipeline.sink import Result, Sink, Step


def explore(
    explorer: Explorer,
    may_step: Callable[[], bool] = lambda: True,
    on_step: Callable[[Step], object] = lambda step: None,
    on_drive: Callable[[bool], object] = lambda reached: None,
    on_done: Callable[[], object] = lambda: None,
) -> None:
    """Explore, or drive to goals, until no viewpoint or goal is left to drive to (thesis, chapter 3).

    Args:
        explorer: the robot, its maps and its mission, which decides where to go.
        may_step: called before each step; exploration ends if it returns False.
        on_step: receives each step before the drive.
        on_drive: called after each drive; its argument is whether the robot arrived.
        on_done: called after each step that does not end exploration.

    Raises:
        LostError: the robot does not know where it is.
        InputError: the robot does not answer.
    """
    has_waited = False
    while may_step():
        # Sense, localise, map, decide where to go, and plan a path there.
        step = explorer.step()
        on_step(step)
        if step.plan is not None:
            # Drive there; keyframes on the way go into the maps too.
            on_drive(explorer.drive(step))
        # Without a plan, look once more if the maps can be corrected: a loop closure merges doubled walls, which may
        # have cut off the area behind them.
        elif not explorer.apply_corrections() or has_waited:
            return
        has_waited = step.plan is None
        on_done()


@dataclass(frozen=True)
class RunParts:
    """The parts of every run, whether the robot is simulated, recorded or real.

    Attributes:
        mapper: holds all maps.
        folder: where the run writes its files.
        place_name: name of the mapped place.
        recorder: writes the Rerun recording.
        rescue_report: writes the report on the people found.
        sinks: all sinks, in the order in which they receive the result.
        plugins: the plug-ins of the run.
    """

    mapper: Mapper
    folder: Path
    place_name: str
    recorder: Recorder
    rescue_report: RescueReport
    sinks: list[Sink]
    plugins: Sequence[Plugin] = ()


def _show_no_progress(progress: Progress) -> None:
    """Show no progress."""


class Run:
    """A mapper and the sinks that watch it until the run ends.

    Attributes:
        parts: the parts of the run.
        mapper: holds all maps.
        recorder: writes the Rerun recording.
        report: the content of report.json, once it is written.
    """

    def __init__(self, parts: RunParts):
        self.parts, self.mapper, self.recorder = parts, parts.mapper, parts.recorder
        self.report: dict[str, Any] = {}
        self._watch: Callable[[Progress], object] = _show_no_progress
        self.start_clock()

    def start_clock(self) -> None:
        """Start measuring the run's wall time."""
        self._wall_begin = perf_counter()

    def finish(
        self, trajectory: EstimatedTrajectory[Any], steps: int, sim_time: float, figures: dict[str, Any]
    ) -> None:
        """Correct the maps one last time and let every sink write its results, even if another sink fails.

        Ctrl-C is ignored meanwhile, because the user may have ended the run with Ctrl-C.

        Args:
            trajectory: the estimated trajectory.
            steps: number of steps; without any steps, only the reason for this is reported.
            sim_time: duration of the run by the robot's clock, s.
            figures: the run's own figures for report.json.
        """
        times = sim_time, perf_counter() - self._wall_begin
        result = Result(self.parts.folder, self.mapper, trajectory, steps, *times, figures, self.report)
        phases: list[tuple[str, Callable[[], object]]] = (
            [("correcting the maps", self.mapper.apply_corrections)] if steps else []
        )
        # A user's own sink may lack ``finishing``.
        phases += [
            (getattr(sink, "finishing", Sink.finishing), partial(sink.finish, result)) for sink in self.parts.sinks
        ]
        with uninterrupted():
            run_all(*(partial(self._show_phase, *phase) for phase in phases))

    def _show_phase(self, name: str, action: Callable[[], object]) -> None:
        self._watch(Progress(f"{self.parts.place_name}: {name}"))
        action()


class MappingRun(Run):
    """A run in which sarsim does not drive: a recording, or a robot driven by hand.

    Attributes:
        labelled: indices of the labelled keyframes.
    """

    def __init__(self, parts: RunParts):
        super().__init__(parts)
        self.labelled: list[int] = []
        parts.mapper.observers += parts.sinks

    def show(self, keyframe: Keyframe) -> None:
        """Log a labelled keyframe, and the maps that now include it, to the recording."""
        self.recorder.log_keyframe(len(self.labelled), self.mapper, keyframe)
        self.labelled.append(keyframe.index)


TASK_TEXTS = {"goals": "driving to the goals", "home": "driving home", "park": "driving to a victim"}
"""The tasks after exploration, as shown in the progress."""


class ExplorerRun(Run, ABC):
    """A run of a simulated or real robot that explores, drives to goals and returns home.

    Attributes:
        explorer: drives the robot.
        lost_reason: why localisation failed; None if it has not failed.
        end_reason: why exploration ended: ``nothing_left``, ``not_worth_it``, ``unreachable``, ``held``, ``shut_in``,
            ``lost``, ``interrupted``, ``time`` or ``steps``.
    """

    def __init__(
        self,
        explorer: Explorer,
        parts: RunParts,
        trajectory: EstimatedTrajectory[Any],
        steps: float,
        goals: Sequence[ArrayLike] = (),
        home: bool = False,
    ):
        """Start at the robot's current position.

        Args:
            explorer: drives the robot.
            parts: the parts of the run.
            trajectory: the estimated trajectory.
            steps: maximum number of exploration steps, ignored if the mission has a time limit; with 0, the robot
                drives to its goals at once.
            goals: positions to drive to, each (2,) in ``map``, m.
            home: whether to drive back to the start at the end.
        """
        super().__init__(parts)
        self.explorer, self._faults = explorer, explorer.pilot.faults
        self._trajectory, self._steps, self._goals, self._home = trajectory, steps, goals, home
        explorer.watch(*parts.sinks)
        self.lost_reason: str | None = None
        self._logged_faults = 0
        self.end_reason = "interrupted"
        self._viewpoints_left: list[Viewpoint] = []
        self._relocalised = explorer.pilot.pose_check.relocalised

    @property
    def mapped_text(self) -> str:
        """The mapped area, as text."""
        elevation_map = self.mapper.elevation_map
        area = np.isfinite(elevation_map.measured).sum() * elevation_map.grid.cell**2
        return f"{area:.0f} m² mapped"

    @property
    def explored_text(self) -> str:
        """How much has been explored so far, as text for the progress; it may lag behind the robot."""
        return self.mapped_text

    def run(
        self,
        interrupted: Callable[[], bool] = lambda: False,
        on_progress: Callable[[Progress], object] = _show_no_progress,
    ) -> bool:
        """Explore, drive to the goals and home, and write the results.

        Args:
            interrupted: called before each step; the run ends if it returns True.
            on_progress: called before the first step, after each step, and before each phase of writing the results.

        Returns:
            True unless the run was interrupted.
        """
        begin, self._watch = self._time(), on_progress
        self.start_clock()
        on_progress(Progress(f"{self.parts.place_name}: taking a first look"))
        for plugin in self.parts.plugins:
            plugin.begin(self.explorer, begin)
        mission = self.explorer.mission
        try:
            for task in mission.tasks(self._goals, self._home, self.explorer, explores=self._steps > 0):
                self._explore(
                    may_step=lambda: self._may_step() and not interrupted(),
                    on_done=partial(self._show_progress, str(task)),
                )
                if mission.explores and self.end_reason == "interrupted" and not interrupted():
                    self.end_reason = "steps"
            self._log_outcomes()
        except TimeIsUpError:
            self.end_reason = "time" if mission.explores else self.end_reason
        except LostError as error:
            self.lost_reason = str(error)
            self.end_reason = "lost" if mission.explores else self.end_reason
            self._note_fault("lost", f"the robot is lost and has stopped: {error}")
        finally:
            self._finish(self._time() - begin)
        return not interrupted()

    def _explore(self, may_step: Callable[[], bool], on_done: Callable[[], object]) -> None:
        """Take the steps of the current task, and log them."""
        explore(self.explorer, may_step, self._log_step, self._log_drive, on_done)

    def _show_progress(self, task: str) -> None:
        self._watch(self._progress_of(task))

    def _progress_of(self, task: str) -> Progress:
        """Progress after a step of a task: fraction of the mission's time or, without one, of the ground explored."""
        doing = TASK_TEXTS.get(task, task)
        text, deadline = f"{self.parts.place_name}: {doing}, {self.explored_text}", self.explorer.mission.deadline
        if deadline is None:
            return Progress(f"{text}, step {self.explorer.steps}", self._explored_fraction())
        past, all_of_it = self._time() - deadline.begin, deadline.end - deadline.begin
        minutes = f"{past / 60:.1f} of {all_of_it / 60:g} min"
        return Progress(f"{text}, {minutes}", min(past / all_of_it, 1.0), is_timed=True)

    def _explored_fraction(self) -> float | None:
        """Explored fraction of the ground, 0 to 1; None if it is unknown, for example without a simulator."""
        return None

    def _may_step(self) -> bool:
        """Whether the task may continue; exploration has a maximum number of steps, but drives to goals have none."""
        mission = self.explorer.mission
        mission.may_explore = mission.deadline is not None or self.explorer.steps < self._steps
        return mission.may_explore or not mission.explores

    def _log_step(self, step: Step) -> None:
        pilot = self.explorer.pilot
        self._log_outcomes()
        self._log_faults()
        if step.was_carried:
            found_itself = pilot.pose_check.relocalised > self._relocalised
            how = "looked around and was localised" if found_itself else "was carried and set down"
            self._note_fault("carried", f"the robot {how} at {place_name(step.keyframe.T_map_base[:2, 3])}")
        self._relocalised = pilot.pose_check.relocalised
        self._log("INFO" if step.can_drive else "WARN", self._step_line(step))
        if step.explores:
            self.end_reason = step.end_reason or "interrupted"
            self._viewpoints_left = step.viewpoints_left

    def _log_drive(self, reached: bool) -> None:
        if reached:
            return
        leg = self.explorer.pilot.navigator.legs[-1]
        line = f"the drive to {place_name(leg.target)} ended: {leg.outcome.value}"
        if leg.outcome is Outcome.STUCK:
            self._note_fault("stuck", line)
        else:
            self._log("WARN", line)

    def _note_fault(self, kind: str, text: str) -> None:
        self._faults.note(kind, self._time(), text)
        self._log_faults()

    def _log_faults(self) -> None:
        """Log the faults that have not been logged yet."""
        faults = self._faults.all
        for fault in faults[self._logged_faults :]:
            self._log("WARN", fault.text)
        self._logged_faults = len(faults)

    def _log(self, level: Level, line: str) -> None:
        self.recorder.log_message(level, line)

    def _log_outcomes(self) -> None:
        for line, is_good in self.explorer.mission.new_outcomes():
            self._log("INFO" if is_good else "WARN", line)

    def _step_line(self, step: Step) -> str:
        """The outcome of a step, as a line for the log."""
        if not step.can_drive:
            return f"{self.mapped_text}; the robot cannot leave its current position"
        if step.viewpoint is None:
            finished = "exploration finished: no remaining viewpoint is worth the drive"
            return f"{self.mapped_text}; {finished if step.explores else 'there is no goal left to drive to'}"
        place = place_name(step.viewpoint.position)
        if step.plan is None:
            return f"{self.mapped_text}; no path leads to the viewpoint {place}"
        nodes = ", ".join(map(str, step.plan.nodes))
        way = f"path of {step.plan.length:.1f} m via nodes {nodes}" if nodes else f"path of {step.plan.length:.1f} m"
        if not step.viewpoint.gain:
            return f"{self.mapped_text}; next viewpoint {place}; {way}"
        heading = np.degrees(step.viewpoint.heading)
        gain = f"{step.viewpoint.gain:.2f} m² of new ground"
        return f"{self.mapped_text}; next viewpoint {place}, heading {heading:.0f}°; {way}; expected to show {gain}"

    def _finish(self, sim_time: float) -> None:
        """Write the results of a run that took ``sim_time`` s by the robot's clock."""
        self.finish(self._trajectory, self.explorer.steps, sim_time, self._figures())

    def _figures(self) -> dict[str, Any]:
        """Figures of exploration, tasks and faults for report.json."""
        left = [_given_up(view) for view in self._viewpoints_left]
        exploration = {"exploration": {"ended": self.end_reason, **({"left": left} if left else {})}}
        return {
            **(exploration if self._steps else {}),
            **self.explorer.mission.report(),
            **({"lost": self.lost_reason} if self.lost_reason else {}),
            "faults": [asdict(fault) for fault in self._faults.all],
        }

    @abstractmethod
    def _time(self) -> float:
        """The time on the robot's clock, s."""


def _given_up(view: Viewpoint) -> dict[str, Any]:
    """An entry of ``exploration.left`` in report.json; it has no ``seconds`` if no path leads to the viewpoint."""
    seconds = {"seconds": view.seconds} if view.is_reachable else {}
    return {"position": view.position.tolist(), "area_m2": view.gain, **seconds, "why": view.why}
