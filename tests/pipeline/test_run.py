"""A robot that stands before a wall: what its sinks see, and what is left whatever fails."""

import json
import signal
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from pipeline.exploration.viewpoint import Viewpoint
from pipeline.explorer import Explorer
from pipeline.frame import Frame
from pipeline.io_config import IoConfig
from pipeline.localisation.localisation import LostError
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.mapper import Mapper
from pipeline.plugin import Plugin, RunContext
from pipeline.plugins.league.config import LeagueConfig
from pipeline.plugins.league.validation import handed_in_files
from pipeline.rerun.recorder import Recorder
from pipeline.rescue_report.report import RescueReport
from pipeline.results import result_sinks
from pipeline.run import ExplorerRun, RunParts
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.sink import Sink
from pipeline.transforms import from_yaw
from sarsim.plugins.league.plugin import League
from sarsim.settings import MissionConfig
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import StillRobot

MAPS = {"keyframes.npz", "metric_map.npz", "semantic_map.ply", "topology.json"}
REST = {
    "trajectory_estimated.tum",
    "episode.rrd",
    "report.json",
    "report.html",
    "victims.json",
    "victims.csv",
    "finds.json",
}


@dataclass(frozen=True)
class Settings:
    out: Path
    weights: tuple[Path, Path] = Path("a/b"), Path("/home/someone/c")
    io: IoConfig = IoConfig()


@dataclass(frozen=True)
class Here:
    """Where the robot stands."""

    time: float = 0.0
    T_odom_base: np.ndarray = field(default_factory=lambda: np.eye(4))


class Diary(Sink):
    """Writes down the events, and adds a figure to the report."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def on_motion(self, motion) -> None:
        self.lines.append("motion")

    def on_keyframe(self, keyframe) -> None:
        self.lines.append(f"keyframe {keyframe.index}")

    def on_step(self, mapper, step) -> None:
        self.lines.append(f"step {step.number}")

    def finish(self, result) -> None:
        self.lines.append("end")
        result.add({"stage": {"figure": 1}})


class OneStep(ExplorerRun):
    """A run of one step, or of more."""

    def __init__(self, out: Path, steps: int = 1, plugins: Sequence[Plugin] = ()):
        mapper, self.diary, recorder = Mapper(PIONEER, TruthClassifier()), Diary(), Recorder(out / "episode.rrd")
        report = RescueReport(recorder)
        explorer = Explorer(StillRobot(), mapper)
        context = RunContext(mapper, recorder, explorer, None, plugins)
        added = [sink for plugin in plugins for sink in plugin.sinks(context)]
        sinks = result_sinks(Settings(out), "here", 7, recorder, report, [self.diary, *added])
        parts = RunParts(mapper, out, "here", recorder, report, sinks, plugins)
        trajectory = EstimatedTrajectory(mapper.localisation, [Here()])
        super().__init__(explorer, parts, trajectory, steps)

    def _time(self) -> float:
        return float(self.explorer.steps)


def test_sinks_see_each_event_and_the_results_are_whole(tmp_path: Path) -> None:
    run = OneStep(tmp_path)
    assert run.run()
    keyframe, step, *motions, end = run.diary.lines
    assert (keyframe, step, set(motions), end) == ("keyframe 0", "step 0", {"motion"}, "end")
    assert {file.name for file in tmp_path.iterdir()} == MAPS | REST
    report = json.loads((tmp_path / "report.json").read_text())
    assert report == json.loads(json.dumps(run.report))
    assert (report["arena"], report["seed"], report["steps"], report["sim_time_s"]) == ("here", 7, 1, 1.0)
    assert report["config"] == {"out": tmp_path.name, "weights": ["a/b", "c"], "plugins": []}
    assert "/home" not in (tmp_path / "report.html").read_text()
    assert report["stage"] == {"figure": 1}
    assert report["exploration"] == {"ended": "steps"}
    assert [fault["kind"] for fault in report["faults"]] == ["stuck"]  # for this robot never moves


def blank(frame: Frame) -> Frame:
    return replace(frame, depth=np.nan * frame.depth)


@pytest.mark.parametrize(
    ("fault", "kinds"),
    [
        (lambda frame, count: replace(frame, depth=1.05 * frame.depth), ["depth_scale"]),
        (lambda frame, count: replace(blank(frame), T_odom_base=from_yaw(0, 0, 0, count)), ["lost"]),
        (lambda frame, count: replace(frame, T_odom_base=np.nan * frame.T_odom_base), ["lost"]),
        (lambda frame, count: replace(frame, T_base_camera=np.nan * frame.T_base_camera), ["lost"]),
        (lambda frame, count: frame if count != 2 else frame.nothing, ["camera"]),
        (lambda frame, count: frame if count < 2 else frame.nothing, ["camera", "lost"]),
    ],
)
def test_a_faulty_robot_is_reported_and_costs_no_map(fault, kinds: list[str], tmp_path: Path, monkeypatch) -> None:
    run = OneStep(tmp_path, steps=12)
    good, counter = run.explorer.pilot.robot.sense, count()
    monkeypatch.setattr(run.explorer.pilot.robot, "sense", lambda: fault(good(), next(counter)))
    run.run()
    noticed = dict.fromkeys(fault["kind"] for fault in run.report["faults"])
    assert [kind for kind in noticed if kind != "stuck"] == kinds
    assert bool(run.lost_reason) == ("lost" in kinds)
    assert {file.name for file in tmp_path.iterdir()} >= (MAPS if run.explorer.steps else {"report.json"})


VIEW = Viewpoint(np.array([1.0, 2.0]), 0.0, turn=True, gain=0.03, seconds=27.0)


@pytest.mark.parametrize(
    ("ended", "left"), [("nothing_left", []), ("not_worth_it", [VIEW]), ("held", []), ("shut_in", [])]
)
def test_the_report_says_why_exploring_ended_and_what_was_left(ended, left, tmp_path, monkeypatch):
    run = OneStep(tmp_path, steps=9)

    def choose(context):
        context.paths.start = None if ended == "shut_in" else context.paths.start

    monkeypatch.setattr(run.explorer.mission, "choose", choose)
    monkeypatch.setattr(run.explorer.mission, "leftovers", lambda context: left)
    monkeypatch.setattr(Explorer, "is_held", property(lambda explorer: ended == "held"))
    run.run()
    expected = {"left": [{"position": [1.0, 2.0], "area_m2": 0.03, "seconds": 27.0, "why": "unseen"}]} if left else {}
    assert run.report["exploration"] == {"ended": ended} | expected


def test_a_viewpoint_to_which_no_path_leads_ends_exploration(tmp_path, monkeypatch):
    run, outside = OneStep(tmp_path, steps=9), replace(VIEW, position=np.array([99.0, 0.0]))
    monkeypatch.setattr(run.explorer.mission, "choose", lambda context: outside)
    run.run()
    assert run.report["exploration"] == {"ended": "unreachable"} and run.explorer.steps == 1


def test_a_corrected_map_is_looked_at_again_but_once(tmp_path, monkeypatch):
    run, steps = OneStep(tmp_path, steps=9), []
    step = replace(run.explorer.step(), viewpoint=None, plan=None)
    monkeypatch.setattr(run.explorer, "step", lambda: steps.append(step) or step)
    monkeypatch.setattr(run.explorer, "apply_corrections", lambda: True)
    run.run()
    assert len(steps) == 2


def test_a_robot_that_is_lost_or_stopped_in_the_middle_says_so(tmp_path, monkeypatch):
    def lose_its_place():
        raise LostError("dark")

    for name, step, ended in (("a", lose_its_place, "lost"), ("b", None, "interrupted")):
        (tmp_path / name).mkdir()
        run = OneStep(tmp_path / name)
        calls = iter([False, True, True, True])
        if step:
            monkeypatch.setattr(run.explorer, "step", step)
        run.run(interrupted=lambda calls=calls: next(calls))
        assert run.report["exploration"] == {"ended": ended}


@pytest.mark.parametrize("failing", ["topology.json", "the end"])
def test_a_failure_costs_no_result_but_its_own(failing: str, tmp_path: Path) -> None:
    run = OneStep(tmp_path)

    def fail(*args: object) -> None:
        raise ZeroDivisionError

    if failing == "the end":
        run.diary.finish = fail
    else:
        run.explorer.mapper.topological_map.save = fail
    with pytest.raises(ZeroDivisionError):
        run.run()
    assert {file.name for file in tmp_path.iterdir()} == (MAPS | REST) - {failing}


class ShortMission(OneStep):
    """A mission of 12 s of a robot that counts its seconds; one step is all that it may explore without a clock."""

    def __init__(self, out: Path):
        super().__init__(out, plugins=[League(LeagueConfig(), MissionConfig(mission="league", minutes=0.2))])

    def _time(self) -> float:
        return self.explorer.pilot.robot.time


def what_is_handed_in(out: Path) -> list[int]:
    return [len(handed_in_files(out)[ending]) for ending in (".tiff", ".ply", ".csv")]


def test_the_clock_ends_a_mission_in_the_middle_of_a_drive_and_the_steps_do_not(tmp_path, monkeypatch):
    mission = ShortMission(tmp_path)
    monkeypatch.setattr(Explorer, "is_held", property(lambda explorer: False))
    drive = mission.explorer.drive
    step = mission.explorer.step()
    monkeypatch.setattr(mission.explorer, "step", lambda: step)
    monkeypatch.setattr(mission.explorer, "drive", lambda step: [drive(step) for _ in range(9)][-1])
    assert mission.run()
    assert mission.report["exploration"] == {"ended": "time"}
    assert mission.explorer.pilot.robot.time == pytest.approx(12, abs=2 * mission.explorer.pilot.robot.control_period)
    assert what_is_handed_in(tmp_path) == [1, 1, 1]


@pytest.mark.parametrize("ended", ["held", "lost", "interrupted"])
def test_it_is_handed_in_whatever_happens(ended, tmp_path, monkeypatch):
    mission = ShortMission(tmp_path)
    step = mission.explorer.step()

    def end():
        if ended == "lost":
            raise LostError("dark")
        return replace(step, viewpoint=None, plan=None, end_reason=ended) if ended == "held" else step

    monkeypatch.setattr(mission.explorer, "step", end)
    monkeypatch.setattr(Explorer, "is_held", property(lambda explorer: ended == "held"))
    calls = count()
    mission.run(interrupted=lambda: ended == "interrupted" and next(calls) > 0)
    assert mission.report["exploration"]["ended"] == ended
    assert what_is_handed_in(tmp_path) == [1, 1, 1]


def test_ctrl_c_while_results_are_written_costs_none(tmp_path, monkeypatch):
    mission, monitored = ShortMission(tmp_path), signal.getsignal(signal.SIGINT)
    mission.diary.finish = lambda result: signal.raise_signal(signal.SIGINT)
    save = mission.explorer.mapper.topological_map.save
    monkeypatch.setattr(
        mission.explorer.mapper.topological_map, "save", lambda path: (signal.raise_signal(signal.SIGINT), save(path))
    )
    mission.run(interrupted=lambda: mission.explorer.steps > 0)
    assert mission.report["exploration"]["ended"] == "interrupted"
    assert what_is_handed_in(tmp_path) == [1, 1, 1]
    assert (tmp_path / "report.html").exists()
    assert signal.getsignal(signal.SIGINT) == monitored


def test_without_a_mission_nothing_is_handed_in(tmp_path):
    OneStep(tmp_path).run()
    assert not (tmp_path / "handed_in").exists()
