"""Expeditions: a robot, simulated (an episode) or real, explores, builds maps, writes a recording and a report."""

import json
from collections.abc import Callable
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.explorer import Explorer, Step
from pipeline.files import each, whole_file
from pipeline.localisation.localisation import LostError
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.slam import Slam
from pipeline.map_file import load_keyframes
from pipeline.mapper import Keyframe, Mapper
from pipeline.planning.path_plan import place_name
from pipeline.rerun.recorder import Recorder
from pipeline.rescue_report.report import RescueReport, write_page
from pipeline.rescue_report.situation import Situation
from pipeline.results import KEYFRAMES, save_maps
from pipeline.robot import Robot
from pipeline.ros.recorded_robot import ExplorerBag, RecordedRobot
from pipeline.ros.topics import Joints
from pipeline.semantic_map.classifier import PointClassifier, TruthClassifier, own_classifier
from pipeline.semantic_map.networks.classifier import NetworkClassifier
from pipeline.semantic_map.rules import RuleClassifier
from pipeline.traversability.elevation_map import CELL
from pipeline.victims.detection.detector import VictimDetector
from sarsim.arenas.fiducials import hang_fiducials
from sarsim.arenas.load import load_arena
from sarsim.assets import asset
from sarsim.recording import EpisodeRecorder
from sarsim.robots.skid_steered import WHEELS
from sarsim.scoring.episode import EpisodeScore
from sarsim.scoring.trajectory import TrajectoryScore
from sarsim.settings import POINT_NETWORKS, EpisodeConfig, Labels, MapRecording, RosExploration
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

if TYPE_CHECKING:
    from sarsim.dataset.exports.tum import TumDrive


class Expedition:
    """An explorer with a robot, simulated or real, and its observers: the rescue report and the recorder.

    Attributes:
        out: folder for the results.
        explorer: with all maps.
        mission: the explorer's mission.
        recorder: writes the Rerun recording.
        trajectory: the estimated trajectory.
        situation: what rescuers need to know; set at the end.
        report: the content of report.json; set at the end.
        lost: why localisation failed; None if it did not.
    """

    recorder: Recorder
    trajectory: TrajectoryScore
    situation: Situation
    report: dict[str, Any]

    def __init__(self, config: EpisodeConfig | RosExploration, explorer: Explorer):
        """Begin where the explorer's robot stands; InputError if an earlier map cannot be read."""
        self.config, self.out, self.explorer = config, config.folder, explorer
        if config.map:
            load_keyframes(config.map / KEYFRAMES, explorer.mapper)
        self.mission = self.explorer.mission
        self.rescue_report = RescueReport(self.explorer)
        self.explorer.keyframing.on_keyframe = self._add_keyframe
        self.lost: str | None = None

    @property
    def place(self) -> str:
        """Name of the place that is explored."""
        return self.config.arena if isinstance(self.config, EpisodeConfig) else self.out.name

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
        self._wall_start, self._sim_start = perf_counter(), self._time()
        try:
            for task in self.mission.tasks(list(self.config.goals), self.config.home, self.explorer):
                while self._may_step() and not interrupted() and self.step():
                    on_step(f"{self.place}: {task}, {self.explored}")
            self._log_news()
        except LostError as error:
            self.lost = str(error)
            self.recorder.log_message("WARN", f"the robot does not know where it is and stays: {error}")
        finally:
            self._finish()
        return not interrupted()

    def _may_step(self) -> bool:
        """Whether the task continues: exploration is limited to ``config.steps``, driving to goals is not."""
        self.mission.may_explore = self.explorer.steps < self.config.steps
        return self.mission.may_explore or self.mission.goals is not None

    def _log_news(self) -> None:
        for line, is_good in self.mission.news():
            self.recorder.log_message("INFO" if is_good else "WARN", line)

    def step(self) -> bool:
        """One step of the robot: sense, map, plan, drive; False when there is nowhere to drive to."""
        relocalised = self.explorer.keyframing.pose_check.relocalised
        step = self.explorer.step()
        self._add(step)
        self.rescue_report.add(step)
        self.recorder.log_step(self.explorer.steps - 1, self.explorer, step)
        self._log_news()
        if step.was_kidnapped:
            how = (
                "looked around and found itself"
                if self.explorer.keyframing.pose_check.relocalised > relocalised
                else "was kidnapped and set down"
            )
            self.recorder.log_message("WARN", f"the robot {how} at {place_name(step.keyframe.T_map_base[:2, 3])}")
        self.recorder.log_message("INFO" if step.can_drive else "WARN", self._tell(step))
        if step.plan is None:
            # Closing a loop merges doubled walls, which may have cut off the area behind them.
            return self.explorer.settle()
        if not self.explorer.drive(step):
            leg = self.explorer.navigator.legs[-1]
            self.recorder.log_message("WARN", f"leg to {place_name(leg.target)} ended: {leg.outcome.value}")
        return True

    def _tell(self, step: Step) -> str:
        """The outcome of a step as a line for the log."""
        if not step.can_drive:
            return f"{self.explored}; the robot stands where it cannot drive"
        if step.viewpoint is None or step.plan is None:
            nothing = "that is worth a keyframe" if self.mission.goals is None else "to drive to"
            return f"{self.explored}; nothing is left {nothing}"
        place, nodes = place_name(step.viewpoint.position), ", ".join(map(str, step.plan.nodes))
        way = f"{step.plan.length:.1f} m {f'over nodes {nodes}' if nodes else 'straight'}"
        if not step.viewpoint.gain:
            return f"{self.explored}; next to {place}, {way}"
        heading = np.degrees(step.viewpoint.heading)
        return f"{self.explored}; next from {place} towards {heading:.0f}°, {way}, for {step.viewpoint.gain:.2f} m²"

    def _finish(self) -> None:
        """Write the maps, then the other results, each by itself: a late failure costs no result but its own."""
        wall_time, sim_time = perf_counter() - self._wall_start, self._time() - self._sim_start
        has_truth = isinstance(self.config, EpisodeConfig)
        if not self.explorer.steps:
            each(self.recorder.close, *([lambda: self._report(sim_time, wall_time)] if self.lost else []))
            return
        each(
            self.explorer.settle,
            lambda: save_maps(self.explorer.mapper, self.out),
            lambda: self.trajectory.save(self.out, with_truth=has_truth),
            self._assess,
            self.recorder.close,
            lambda: self._report(sim_time, wall_time),
            lambda: write_page(self.out / "report.html", self.situation, self.report),
        )

    def _assess(self) -> None:
        """Find what rescuers need to know."""
        self.situation = self.rescue_report.situation
        self.recorder.log_ways([p.route.trace for p in self.situation.everyone if p.route])

    def _report(self, sim_time: float, wall_time: float) -> None:
        """Write report.json, with times in s."""
        self.report = {
            "arena": self.place,
            "seed": self.config.seed if isinstance(self.config, EpisodeConfig) else 0,
            "steps": self.explorer.steps,
            **run_report(self.config, self.out, sim_time, wall_time, self.explorer.mapper),
            **self._figures(),
            **self.mission.report(),
            **({"lost": self.lost} if self.lost else {}),
        }
        write_report(self.report, self.out)

    def _add_keyframe(self, keyframe: Keyframe) -> None:
        """Add the newest keyframe to the results."""
        raise NotImplementedError

    def _add(self, step: Step) -> None:
        """Add the newest step to the results."""
        raise NotImplementedError

    def _time(self) -> float:
        """The robot's time, s."""
        raise NotImplementedError

    def _figures(self) -> dict[str, Any]:
        """The figures of the stages for report.json."""
        raise NotImplementedError


class Episode(Expedition):
    """An expedition in a simulated arena, and its score."""

    config: EpisodeConfig

    def __init__(self, config: EpisodeConfig):
        """Raises InputError if the arena, the output folder or the viewer is not available."""
        if config.steps < 1 or config.seed < 0:
            raise InputError(f"--steps {config.steps} --seed {config.seed}: at least 1 step, and no negative seed")
        if not np.isfinite(config.goals).all():
            raise InputError(f"--goals {' '.join(f'{x:g} {y:g}' for x, y in config.goals)}: no place is there")
        classifier = make_classifier(config.labels, config.weights)
        detector = VictimDetector.load(*config.detector) if config.detector else None
        arena = load_arena(config.arena, config.start, config.random)
        fiducials = hang_fiducials(arena, config.fiducials, config.seed)
        make_folder(config.folder)
        simulation = SimulationConfig(
            config.odometry, config.sensor, config.lighting, config.dust, config.speed, config.robot
        )
        self.config, self.robot = config, SimulatedRobot(arena, simulation, config.seed)
        self.bag = ExplorerBag(config.bag, config.bag_images, self.robot) if config.bag else None
        self.tum: TumDrive | None = None
        is_told = config.odometry == "truth" or config.localisation == "odometry"
        localisation = OdometryLocalisation() if is_told else Slam()
        model, voxel_size, graph, seed = self.robot.model, config.voxel_size, config.graph, config.seed
        mapper = Mapper(model, classifier, detector, voxel_size, graph, seed, localisation)
        super().__init__(config, Explorer(self._recorded(), mapper))
        self.score = EpisodeScore(self.robot, self.explorer, fiducials)
        self.trajectory = self.score.trajectory
        self.recorder: EpisodeRecorder = EpisodeRecorder(self.robot, self.out / "episode.rrd", config.view)
        self.robot.on_motion = self.recorder.log_motion
        if self.bag:
            self.bag.watch(self.explorer)
        self.explorer.on_correction = self.recorder.log_correction

    def _recorded(self) -> Robot:
        """The robot; if a bag or a TUM sequence is wanted, wrapped so that these are recorded."""
        robot: Robot = self.robot
        if self.bag:
            robot = self.bag.robot
            robot.T_world_base = self._T_world_base
            robot.joints = lambda: Joints(WHEELS, *self.robot.wheels)
        if self.config.tum:
            from sarsim.dataset.exports.tum import TumDrive  # imports HDF5, which episodes do not need otherwise

            self.tum = TumDrive(self.config.tum, self.config.seed)
            robot = RecordedRobot(robot, self.tum)
            robot.T_world_base = self._T_world_base
        return robot

    @property
    def explored(self) -> str:
        """How much is explored, as text."""
        return f"{self.score.coverage.fraction:.0%} explored"

    def _add_keyframe(self, keyframe: Keyframe) -> None:
        self.score.add_keyframe(keyframe)
        if self.bag:
            self.bag.add_keyframe(keyframe)
        if self.tum:
            self.tum.keyframe(keyframe.frame.time, len(keyframe.labels) > 0)

    def _add(self, step: Step) -> None:
        self.score.add(step)
        if self.bag:
            self.bag.add(step)
        if self.tum:
            self.tum.keyframe(step.keyframe.frame.time, len(step.keyframe.labels) > 0, stood=True)

    def _T_world_base(self) -> NDArray[np.float64]:
        """4×4 true pose of the robot."""
        return self.robot.trajectory[-1].T_world_base

    def _time(self) -> float:
        return self.robot.time

    def _figures(self) -> dict[str, Any]:
        return self.score.report()

    def _finish(self) -> None:
        try:
            super()._finish()
        finally:
            self.robot.close()
            for recording in (self.bag, self.tum):
                if recording:
                    recording.close()


def make_classifier(labels: Labels, weights: Path | None) -> PointClassifier:
    """The classifier that ``--labels`` names, with ``weights`` or the shipped ones.

    Raises:
        InputError: the weights are missing or belong to another network, or there is no such class.
    """
    if labels == "truth":
        return TruthClassifier()
    if labels == "rules":
        return RuleClassifier()
    if labels not in POINT_NETWORKS:
        return own_classifier(labels)
    weights = weights or asset("weights", f"{labels}.safetensors")
    if not weights.exists():
        raise InputError(f"--weights {weights}: no such file; train.py {labels} makes one, --labels truth needs none")
    return NetworkClassifier(weights, network=labels)


def run_report(
    config: EpisodeConfig | MapRecording | RosExploration,
    out: Path,
    sim_time: float,
    wall_time: float,
    mapper: Mapper,
) -> dict[str, Any]:
    """The entries of report.json that any run has: version, settings, times in s, and of each stage in ms."""
    settings = {name: str(value) if isinstance(value, Path) else value for name, value in asdict(config).items()}
    detector = config.detector and [str(path) for path in config.detector]
    return {
        "version": version("sarsim"),
        "config": settings | {"out": str(out), "detector": detector},
        "sim_time_s": sim_time,
        "wall_time_s": wall_time,
        "real_time_factor": sim_time / wall_time,
        "timing_ms": {stage: percentiles(times) for stage, times in mapper.stopwatch.seconds.items()},
    }


def write_report(report: dict[str, Any], folder: Path) -> None:
    """Write report.json; InputError if that is impossible."""
    with whole_file(folder / "report.json") as path:
        path.write_text(json.dumps(report, indent=1, default=float, allow_nan=False) + "\n")


def percentiles(seconds: list[float]) -> dict[str, float]:
    """Median and 95th percentile, in ms."""
    return {"median": 1e3 * float(np.median(seconds)), "p95": 1e3 * float(np.percentile(seconds, 95))}


def make_folder(path: Path) -> None:
    """Make sure that files can be written into a folder; InputError if they cannot."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        with whole_file(path / ".probe") as probe:
            probe.touch()
        (path / ".probe").unlink()
    except OSError as error:
        raise InputError(f"--out {path}: {error.strerror or error}") from error
