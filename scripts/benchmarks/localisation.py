"""Localisation along drives, compared with odometry, KISS-ICP and Open3D's RGB-D odometry.

The robot explores using its true pose, so that a drive does not depend on any of the methods. All methods get the
same frames, in turn, in a single-threaded process, whose processor time is measured. The trajectories stay in the
folder ``--runs`` as TUM files, which evo can draw.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.arrays import Pose
from pipeline.errors import InputError
from pipeline.explorer import Explorer
from pipeline.frame import Frame
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.trajectory import write_tum
from pipeline.robot import Motion
from pipeline.run import explore
from pipeline.sink import Sink
from pipeline.transforms import inverse
from sarsim.arenas.load import load_arena
from sarsim.composition import TRUE_LABELS, make_mapper
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.benchmarks.common import Result, check_at_least
from scripts.benchmarks.kidnappings import kidnap
from scripts.benchmarks.localisation_methods import METHODS, is_blind
from scripts.benchmarks.localisation_scores import distances_driven, evo_ate, trajectory_scores
from scripts.benchmarks.reports import Report, group_figures, reports
from scripts.benchmarks.runs import Job, failures, jobs_of, run_jobs
from scripts.benchmarks.settings import LocalisationSettings

OURS, BASELINES = ("ours", "ours_without_loops"), ("odometry", "kiss_icp", "open3d")
REGISTRATION_BASELINES = BASELINES[1:]
REQUIRED_PACKAGES = ("evo", "kiss_icp")  # Packages that come with ``pip install -e '.[dev]'``
KIDNAPPED_IN = {"nist_6x4": "nist_6x4", "random": "random:1"}
"""The arena in which the robot is kidnapped, by group."""
MAX_FRAMES = 3000  # Maximum number of frames of a drive
FRAME_DISTANCE, FRAME_TURN = 0.1, np.deg2rad(5)  # m and rad, minimum motion between frames
ATE_TOLERANCE = 1e-6  # m, maximum difference between our ATE and evo's, which is computed from rounded files


def measure(settings: LocalisationSettings) -> Result:
    """Run the missing drives, and summarise all drives.

    Raises:
        InputError: there is nothing to drive, a package is missing, or a folder cannot be used.
    """
    check_at_least(0, settings, "kidnappings")
    if missing := [name for name in REQUIRED_PACKAGES if find_spec(name) is None]:
        are = "is" if len(missing) == 1 else "are"
        raise InputError(f"{' and '.join(missing)} {are} not installed; run: pip install -e '.[dev]'")
    base = EpisodeConfig(labels="truth", detector=None, odometry="truth", lighting=settings.lighting)
    # Drive; all methods follow each drive.
    names = (*OURS, *(BASELINES if settings.baselines else ()))
    jobs = list(jobs_of(base, settings)) if settings.arenas or not settings.kidnappings else []
    results = run_jobs(jobs, settings, partial(run_job, names, settings.runs))
    # Figures by group, and over all drives.
    by_group: dict[str, list[dict[str, Any] | None]] = {}
    for job, result in zip(jobs, results, strict=True):
        by_group.setdefault(job.group, []).append(result)
    figures: dict[str, Any] = {}
    for group, of_group in by_group.items():
        figures |= figures_of(group, reports(of_group))
    figures |= overall(reports(results))
    # Carry the robot elsewhere.
    for group, arena in KIDNAPPED_IN.items() if settings.kidnappings else ():
        config = replace(base, arena=arena, odometry="wheel")
        counts = kidnap(config, settings.kidnappings, settings.runs / f"kidnapped-{group}")
        figures |= {f"{group}.kidnapped.{outcome}": float(count) for outcome, count in counts.items()}
    drives = {job.name: r["report"] for job, r in zip(jobs, results, strict=True) if r and "report" in r}
    left_out = {
        job.config.arena: r["left_out"] for job, r in zip(jobs, results, strict=True) if r and "left_out" in r
    }
    failed = failures(jobs, results)
    notes = [drive_line(name, report["ours"]) for name, report in drives.items()]
    notes += [f"{arena} skipped: {reason}" for arena, reason in left_out.items()]
    notes += [f"{name} failed; see its log" for name in failed]
    return Result(figures, {"left_out": left_out, "failed": failed, "drives": drives}, notes)


def run_job(names: Sequence[str], folder: Path, job: Job) -> dict[str, Any]:
    """Drive through an arena with the named methods, and write ``<job>-<method>.tum`` and ``<job>-true.tum``.

    Raises:
        ArithmeticError: our ATE differs from evo's.
    """
    try:
        runner = drive(job.config, names)
    except InputError as error:
        return {"left_out": str(error)}
    # Write the trajectories, with each method's last corrections, and score them.
    true = np.array(runner.true)
    files = {name: folder / f"{job.name}-{name}.tum" for name in (*names, "true")}
    write_tum(files["true"], runner.times, runner.true)
    report: dict[str, Any] = {"frames": len(true), "way_m": float(distances_driven(true)[-1])}
    for name, method in runner.methods.items():
        online = np.array(runner.poses[name])
        final = method.corrected(online)
        write_tum(files[name], runner.times, list(final))
        scores = trajectory_scores(true, final)
        if not abs(scores["ate_m"] - evo_ate(files["true"], files[name])) <= ATE_TOLERANCE:
            raise ArithmeticError(f"{name}: ATE {scores['ate_m']} m differs from evo's")
        frame_ms = 1e3 * float(np.median(runner.seconds[name]))
        report[name] = {**scores, "frame_ms": frame_ms, **method.report(true, online)}
    return {"report": report}


def drive(config: EpisodeConfig, names: Sequence[str]) -> "MethodRunner":
    """Explore an arena using the true pose while the named methods estimate the pose of each frame."""
    simulation = SimulationConfig("truth", config.sensor, config.lighting, config.dust, config.speed)
    robot = SimulatedRobot(load_arena(config.arena), simulation, config.seed)
    runner = MethodRunner(robot, names)
    mapper = make_mapper(TRUE_LABELS, robot.model, config.seed, OdometryLocalisation())
    explorer = Explorer(robot, mapper)
    explorer.watch(runner)
    explore(
        explorer,
        may_step=lambda: explorer.steps < config.max_steps and len(runner.times) < MAX_FRAMES,
        on_step=lambda step: runner.take(step.keyframe.frame),
    )
    robot.close()
    return runner


class MethodRunner(Sink):
    """Gives all methods a frame after each motion of ``FRAME_DISTANCE`` or turn of ``FRAME_TURN``.

    Attributes:
        methods: the methods by name.
        times: time of each frame, s.
        true: true pose (4, 4) of each frame.
        poses: estimates (4, 4) of the frames' poses made during the drive, by method.
        seconds: processor times of the frames with enough returns, s, by method.
    """

    def __init__(self, robot: SimulatedRobot, names: Sequence[str]):
        self._robot = robot
        self._last = robot.trajectory[-1]
        self.methods = {name: METHODS[name](self._last.T_world_base) for name in names}
        self.times: list[float] = []
        self.true: list[Pose] = []
        self.poses: dict[str, list[Pose]] = {name: [] for name in names}
        self.seconds: dict[str, list[float]] = {name: [] for name in names}

    def on_motion(self, motion: Motion) -> None:
        """Take a frame if the robot has moved or turned far enough."""
        moved = inverse(self._last.T_world_base) @ self._robot.trajectory[-1].T_world_base
        turned = Rotation.from_matrix(moved[:3, :3]).magnitude()
        if np.linalg.norm(moved[:3, 3]) >= FRAME_DISTANCE or turned >= FRAME_TURN:
            self.take(self._robot.sense())

    def take(self, frame: Frame) -> None:
        """Localise a frame, with its wheel odometry, unless it was localised before or the robot has moved since.

        A robot that plans while rolling may have come to rest after the frame was taken.
        """
        pose = self._robot.trajectory[-1]
        if pose.time != frame.time or (self.times and pose.time <= self._last.time):
            return
        self._last = pose
        self.times.append(pose.time)
        self.true.append(pose.T_world_base)
        frame = replace(frame, T_odom_base=self._robot.dead_reckoned_T_world_base, label=None)
        for name, method in self.methods.items():
            start = process_time()
            self.poses[name].append(method.localise(frame))
            if not is_blind(frame):
                self.seconds[name].append(process_time() - start)


def figures_of(group: str, scored: Sequence[Report]) -> dict[str, float]:
    """The figures of a group's drives, and the ratios to the baselines."""
    if not scored:
        return {}
    figures: dict[str, float] = {"runs": len(scored), **group_figures(scored)}
    for baseline in BASELINES:
        if (ate := figures.get(f"{baseline}.ate_m.median")) is not None:
            figures[f"{baseline}_vs_ours"] = ate / figures["ours.ate_m.median"]
    return {f"{group}.{key}": value for key, value in figures.items()}


def overall(scored: Sequence[Report]) -> dict[str, float]:
    """Times, loops and NEES over all drives."""
    figures: dict[str, float] = {}
    for key in ("keyframe_ms", "correction_ms", "nees", "within_3_sigma"):
        if values := [report["ours"][key] for report in scored if key in report["ours"]]:
            figures[f"ours.{key}" if key.endswith("ms") else key] = float(np.median(values))
    for key in ("loops", "false_loops"):
        if values := [report["ours"][key] for report in scored if key in report["ours"]]:
            figures[key] = float(sum(values))
    for baseline in REGISTRATION_BASELINES:
        if both := [report for report in scored if baseline in report]:
            ratios = [report[baseline]["frame_ms"] / report["ours"]["keyframe_ms"] for report in both]
            figures[f"{baseline}_vs_ours_time"] = float(np.median(ratios))
    return figures


def drive_line(name: str, ours: Mapping[str, float]) -> str:
    """A line of text with the figures of our localisation on one drive."""
    line = f"{name}: ATE {ours['ate_m']:.3f} m, worst {ours['max_m']:.3f} m"
    if "nees" in ours:
        line += f", NEES {ours['nees']:.2f}, within 3 σ {ours['within_3_sigma']:.1%}"
    return f"{line}, false loops {ours['false_loops']:.0f} of {ours['loops']:.0f}"
