"""An expedition: a robot, simulated or real, explores, drives to goals and home; and the results of any run."""

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from datetime import timedelta
from functools import partial
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pipeline.elevation_map.elevation_map import CELL
from pipeline.exploration.deadline import Deadline
from pipeline.exploration.inspection import Inspection
from pipeline.exploration.viewpoint import Viewpoint
from pipeline.explorer import Explorer, Observer, Step
from pipeline.files import each, uninterrupted, whole_file
from pipeline.league.brief import MissionBrief
from pipeline.league.hand_in import hand_in
from pipeline.league.rules import LIMITS
from pipeline.localisation.localisation import LostError
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.map_file import save_maps
from pipeline.mapper import Mapper
from pipeline.navigation.navigator import Outcome
from pipeline.planning.path_plan import place_name
from pipeline.rerun.recorder import Level, Recorder
from pipeline.rescue_report.report import RescueReport, write_found, write_page
from pipeline.rescue_report.situation import Situation
from pipeline.robot import Motion


@dataclass
class ResultFolder:
    """The results of a run, in a folder.

    Attributes:
        settings: the command's, a dataclass.
        out: the folder.
        place: name of the place that is mapped.
        seed: of all random numbers.
        mapper: all maps.
        recorder: writes the Rerun recording.
        brief: of the mission whose files are handed in; None if there is none.
        report: the content of report.json, once it is written.
    """

    settings: Any
    out: Path
    place: str
    seed: int
    mapper: Mapper
    recorder: Recorder
    brief: MissionBrief | None = None
    report: dict[str, Any] = field(default_factory=dict, init=False)
    _situation: Situation | None = field(default=None, init=False)

    def write(
        self,
        settle: Callable[[], object],
        save_trajectory: Callable[[Path], object],
        find_situation: Callable[[], Situation],
        close: Iterable[Callable[[], object]],
        write_report: Callable[[], object],
    ) -> None:
        """Write the maps, then the other results, each by itself: a late failure costs no result but its own.

        Ctrl-C, which may have ended the run, ends nothing here.

        Args:
            settle: corrects the poses of the keyframes for the last time.
            save_trajectory: writes it into a folder.
            find_situation: what rescuers need to know.
            close: each ends a recording.
            write_report: calls :meth:`write_report`.
        """
        with uninterrupted():
            each(
                settle,
                lambda: save_maps(self.mapper, self.out),
                lambda: save_trajectory(self.out),
                lambda: self._assess(find_situation()),
                self._hand_in,
                *close,
                write_report,
                self._write_page,
            )

    def _assess(self, situation: Situation) -> None:
        self._situation = situation
        write_found(self.out, situation)
        self.recorder.log_ways([person.route.trace for person in situation.everyone if person.route])

    def _hand_in(self) -> None:
        if self.brief is not None:
            hand_in(self.out, self.brief, self.mapper.elevation_map.robot)

    def _write_page(self) -> None:
        if self._situation is not None:
            write_page(self.out / "report.html", self._situation, self.report)

    def write_report(self, steps: int, sim_time: float, wall_time: float, figures: dict[str, Any]) -> None:
        """Write report.json: number of steps, the robot's and the wall's time in s, and ``figures`` of the stages."""
        self.report = {
            "arena": _plain(self.place),
            "seed": self.seed,
            "steps": steps,
            "version": version("sarsim"),
            "config": {name: _plain(value) for name, value in asdict(self.settings).items()}
            | {"out": _plain(self.out)},
            "sim_time_s": sim_time,
            "wall_time_s": wall_time,
            "real_time_factor": sim_time / wall_time,
            "timing_ms": {stage: _percentiles(times) for stage, times in self.mapper.stopwatch.seconds.items()},
            **figures,
        }
        write_report(self.report, self.out)


def _plain(value: Any) -> Any:
    """A setting for JSON; of an absolute path only the name, for the rest may tell who ran it."""
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    is_absolute = isinstance(value, str | Path) and Path(value).is_absolute()
    return Path(value).name if is_absolute else str(value) if isinstance(value, Path) else value


def write_report(report: dict[str, Any], folder: Path) -> None:
    """Write report.json; InputError if that is impossible."""
    with whole_file(folder / "report.json") as path:
        path.write_text(json.dumps(report, indent=1, default=float, allow_nan=False) + "\n")


def _percentiles(seconds: list[float]) -> dict[str, float]:
    """Median and 95th percentile, in ms."""
    ms = 1e3 * np.array(seconds)
    return {"median": float(np.median(ms)), "p95": float(np.percentile(ms, 95))}


class TimeIsUpError(Exception):
    """The clock of a mission has stopped."""


class _Clock(Observer):
    """Ends a drive when the clock stops, s of the robot's time."""

    def __init__(self, end: float):
        self._end = end

    def on_motion(self, motion: Motion) -> None:
        """Raises TimeIsUpError if no time is left."""
        if motion.time >= self._end:
            raise TimeIsUpError


def why_ended(explorer: Explorer, step: Step) -> str:
    """Why exploring ends with a step; if it has a viewpoint, only an interruption can end it there."""
    if step.viewpoint is not None:
        return "interrupted"
    if (deadline := explorer.mission.deadline) is not None and deadline.has_called:
        return "time"
    if explorer.is_held:
        return "held"
    if step.context.paths.start is None:
        return "shut_in"
    return "not_worth_it" if step.left else "nothing_left"


class Expedition(ABC):
    """An explorer on a mission.

    Attributes:
        explorer: with all maps and its observers, which are closed at the end.
        results: of the run.
        lost: why localisation failed; None if it did not.
        ended: why exploring ended: ``nothing_left``, ``not_worth_it``, ``held``, ``shut_in``, ``lost``,
            ``interrupted``, ``time`` or ``steps``.
    """

    def __init__(
        self,
        explorer: Explorer,
        results: ResultFolder,
        trajectory: EstimatedTrajectory[Any],
        steps: int,
        goals: Sequence[ArrayLike] = (),
        home: bool = False,
    ):
        """Begin where the explorer's robot stands.

        Args:
            explorer: that drives the robot.
            results: to fill.
            trajectory: the estimated trajectory.
            steps: most steps of exploring; a mission is ended by its clock instead, that of ``results.brief``.
            goals: (2,) m in ``map`` each, places to drive to afterwards.
            home: whether to drive back to the start at the end.
        """
        self.explorer, self.results = explorer, results
        self._trajectory, self._steps, self._goals, self._home = trajectory, steps, goals, home
        self._rescue_report = RescueReport()
        explorer.observers += [self._rescue_report, results.recorder]
        self.lost: str | None = None
        self._told_faults = 0
        self.ended = "interrupted"
        self._left: list[Viewpoint] = []
        self._waits = False  # whether the last step had no plan, and only looked at a corrected map again

    @property
    def report(self) -> dict[str, Any]:
        """The content of report.json, once it is written."""
        return self.results.report

    @property
    def explored(self) -> str:
        """How much is explored, as text."""
        area = np.isfinite(self.explorer.mapper.elevation_map.measured).sum() * CELL**2
        return f"{area:.0f} m² mapped"

    def run(
        self,
        interrupted: Callable[[], bool] = lambda: False,
        on_step: Callable[[str], object] = lambda description: None,
    ) -> bool:
        """Explore, drive to the goals and home, and write the results.

        Args:
            interrupted: called before each step; the expedition ends if it returns True.
            on_step: called after each step with a line on the task and how much is explored.

        Returns:
            Whether the expedition ended without an interruption.
        """
        begin, wall_begin = self._time(), perf_counter()
        self._start_clock(begin)
        try:
            for task in self.explorer.mission.tasks(self._goals, self._home, self.explorer):
                while self._may_step() and not interrupted() and self.step():
                    on_step(f"{self.results.place}: {task}, {self.explored}")
                if self._explores and self.ended == "interrupted" and not interrupted():
                    self.ended = "steps"
            self._log_outcomes()
        except TimeIsUpError:
            self.ended = "time" if self._explores else self.ended
        except LostError as error:
            self.lost = str(error)
            self.ended = "lost" if self._explores else self.ended
            self._notice("lost", f"the robot does not know where it is and stays: {error}")
        finally:
            self._finish(self._time() - begin, perf_counter() - wall_begin)
        return not interrupted()

    def _start_clock(self, begin: float) -> None:
        """Start the clock of the mission, if there is one, at the robot's time ``begin``, s."""
        if (brief := self.results.brief) is not None:
            mapper, mission = self.explorer.mapper, self.explorer.mission
            finds, end = mapper.finds, begin + timedelta(minutes=brief.minutes).total_seconds()
            beside = LIMITS["beside"] if "park" in brief.tasks else None
            deadline = Deadline(begin, end, lambda: finds.confirmed, "home" in brief.tasks, beside)
            mission.deadline = deadline
            self.explorer.observers.append(_Clock(deadline.end))
            if "find" in brief.tasks and mapper.readers is not None:
                mission.inspection = Inspection(mapper.keyframes, mapper.metric_map)

    @property
    def _explores(self) -> bool:
        """Whether the present task is to explore."""
        return self.explorer.mission.goals is None

    def _may_step(self) -> bool:
        """Whether the task continues: the steps of exploration are limited, those of a drive to goals are not."""
        mission = self.explorer.mission
        mission.may_explore = mission.deadline is not None or self.explorer.steps < self._steps
        return mission.may_explore or mission.goals is not None

    def step(self) -> bool:
        """One step of the robot: sense, map, plan, drive; False when there is nowhere to drive to."""
        relocalised = self.explorer.keyframing.pose_check.relocalised
        step = self.explorer.step()
        self._log_outcomes()
        self._log_faults()
        if step.was_kidnapped:
            found_itself = self.explorer.keyframing.pose_check.relocalised > relocalised
            how = "looked around and found itself" if found_itself else "was kidnapped and set down"
            self._notice("carried", f"the robot {how} at {place_name(step.keyframe.T_map_base[:2, 3])}")
        self._log("INFO" if step.can_drive else "WARN", self._tell(step))
        if self._explores:
            self.ended, self._left = why_ended(self.explorer, step), step.left
        was_waiting, self._waits = self._waits, step.plan is None
        if step.plan is None:
            # Closing a loop merges doubled walls, which may have cut off the area behind them.
            return self.explorer.settle() and not was_waiting
        if not self.explorer.drive(step):
            leg = self.explorer.navigator.legs[-1]
            line = f"leg to {place_name(leg.target)} ended: {leg.outcome.value}"
            if leg.outcome is Outcome.STUCK:
                self._notice("stuck", line)
            else:
                self._log("WARN", line)
        return True

    def _notice(self, kind: str, text: str) -> None:
        self.explorer.keyframing.faults.note(kind, self._time(), text)
        self._log_faults()

    def _log_faults(self) -> None:
        """Log the faults that were not logged yet."""
        faults = self.explorer.keyframing.faults.all
        for fault in faults[self._told_faults :]:
            self._log("WARN", fault.text)
        self._told_faults = len(faults)

    def _log(self, level: Level, line: str) -> None:
        self.results.recorder.log_message(level, line)

    def _log_outcomes(self) -> None:
        for line, is_good in self.explorer.mission.new_outcomes():
            self._log("INFO" if is_good else "WARN", line)

    def _tell(self, step: Step) -> str:
        """The outcome of a step as a line for the log."""
        if not step.can_drive:
            return f"{self.explored}; the robot stands where it cannot drive"
        if step.viewpoint is None or step.plan is None:
            nothing = "that is worth a keyframe" if self.explorer.mission.goals is None else "to drive to"
            return f"{self.explored}; nothing is left {nothing}"
        place, nodes = place_name(step.viewpoint.position), ", ".join(map(str, step.plan.nodes))
        way = f"{step.plan.length:.1f} m {f'over nodes {nodes}' if nodes else 'straight'}"
        if not step.viewpoint.gain:
            return f"{self.explored}; next to {place}, {way}"
        heading = np.degrees(step.viewpoint.heading)
        return f"{self.explored}; next from {place} towards {heading:.0f}°, {way}, for {step.viewpoint.gain:.2f} m²"

    def _finish(self, sim_time: float, wall_time: float) -> None:
        """Write the results of a run that took these times, s."""
        close = [observer.close for observer in self.explorer.observers]

        def write_report() -> None:
            self.results.write_report(self.explorer.steps, sim_time, wall_time, self._figures())

        if self.explorer.steps:
            situation = partial(self._rescue_report.situation, self.explorer)
            self.results.write(self.explorer.settle, self._trajectory.save, situation, close, write_report)
        else:
            each(*close, *([write_report] if self.lost else []))

    def _figures(self) -> dict[str, Any]:
        """The figures of all stages, tasks and failures for report.json."""
        lost = {"lost": self.lost} if self.lost else {}
        faults = {"faults": [asdict(fault) for fault in self.explorer.keyframing.faults.all]}
        stages = self._stages()
        left = [{"position": v.position.tolist(), "area_m2": v.gain, "seconds": v.seconds} for v in self._left]
        ended = {"ended": self.ended, **({"left": left} if left else {})}
        exploration = {"exploration": stages.get("exploration", {}) | ended}
        return stages | exploration | self.explorer.mission.report() | lost | faults

    @abstractmethod
    def _time(self) -> float:
        """The robot's time, s."""

    @abstractmethod
    def _stages(self) -> dict[str, Any]:
        """The figures of the stages for report.json."""
