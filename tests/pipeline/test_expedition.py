"""A robot that stands before a wall: what its observers are told, and what is left whatever fails."""

import json
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from pipeline.expedition import Expedition, ResultFolder
from pipeline.exploration.viewpoint import Viewpoint
from pipeline.explorer import Explorer, Observer
from pipeline.frame import Frame
from pipeline.localisation.localisation import LostError
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.mapper import Mapper
from pipeline.rerun.recorder import Recorder
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.transforms import from_yaw
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


class Diary(Observer):
    """Writes down what it is told."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def on_motion(self, motion) -> None:
        self.lines.append("motion")

    def on_keyframe(self, keyframe) -> None:
        self.lines.append(f"keyframe {keyframe.index}")

    def on_step(self, explorer, step) -> None:
        self.lines.append(f"step {explorer.steps}")

    def close(self) -> None:
        self.lines.append("end")


class OneStep(Expedition):
    """An expedition of one step, or of more."""

    def __init__(self, out: Path, steps: int = 1):
        explorer = Explorer(StillRobot(), Mapper(PIONEER, TruthClassifier()))
        self.diary = Diary()
        explorer.observers.append(self.diary)
        results = ResultFolder(Settings(out), out, "here", 7, explorer.mapper, Recorder(out / "episode.rrd"))
        trajectory = EstimatedTrajectory(explorer.mapper.localisation, [])
        super().__init__(explorer, results, trajectory, steps)

    def _time(self) -> float:
        return float(self.explorer.steps)

    def _stages(self) -> dict:
        return {"stage": {"figure": 1}}


def test_observers_are_told_of_each_event_and_the_results_are_whole(tmp_path: Path) -> None:
    expedition = OneStep(tmp_path)
    assert expedition.run()
    keyframe, step, *motions, end = expedition.diary.lines
    assert (keyframe, step, set(motions), end) == ("keyframe 0", "step 1", {"motion"}, "end")
    assert {file.name for file in tmp_path.iterdir()} == MAPS | REST
    report = json.loads((tmp_path / "report.json").read_text())
    assert report == json.loads(json.dumps(expedition.report))
    assert (report["arena"], report["seed"], report["steps"], report["sim_time_s"]) == ("here", 7, 1, 1.0)
    assert report["config"] == {"out": tmp_path.name, "weights": ["a/b", "c"]}
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
    expedition = OneStep(tmp_path, steps=12)
    good, counter = expedition.explorer.robot.sense, count()
    monkeypatch.setattr(expedition.explorer.robot, "sense", lambda: fault(good(), next(counter)))
    expedition.run()
    noticed = dict.fromkeys(fault["kind"] for fault in expedition.report["faults"])
    assert [kind for kind in noticed if kind != "stuck"] == kinds
    assert bool(expedition.lost) == ("lost" in kinds)
    assert {file.name for file in tmp_path.iterdir()} >= (MAPS if expedition.explorer.steps else {"report.json"})


VIEW = Viewpoint(np.array([1.0, 2.0]), 0.0, turn=True, gain=0.03, seconds=27.0)


@pytest.mark.parametrize(
    ("ended", "left"), [("nothing_left", []), ("not_worth_it", [VIEW]), ("held", []), ("shut_in", [])]
)
def test_the_report_says_why_exploring_ended_and_what_was_left(ended, left, tmp_path, monkeypatch):
    expedition = OneStep(tmp_path, steps=9)
    step = replace(expedition.explorer.step(), viewpoint=None, plan=None, left=left)
    if ended == "shut_in":
        step.context.paths.start = None
    monkeypatch.setattr(expedition.explorer, "step", lambda: step)
    monkeypatch.setattr(Explorer, "is_held", property(lambda explorer: ended == "held"))
    expedition.run()
    told = {"left": [{"position": [1.0, 2.0], "area_m2": 0.03, "seconds": 27.0}]} if left else {}
    assert expedition.report["exploration"] == {"ended": ended} | told


def test_a_corrected_map_is_looked_at_again_but_once(tmp_path, monkeypatch):
    expedition, steps = OneStep(tmp_path, steps=9), []
    step = replace(expedition.explorer.step(), viewpoint=None, plan=None)
    monkeypatch.setattr(expedition.explorer, "step", lambda: steps.append(step) or step)
    monkeypatch.setattr(expedition.explorer, "settle", lambda: True)
    expedition.run()
    assert len(steps) == 2


def test_a_robot_that_is_lost_or_stopped_in_the_middle_says_so(tmp_path, monkeypatch):
    def lose_its_place():
        raise LostError("dark")

    for name, step, ended in (("a", lose_its_place, "lost"), ("b", None, "interrupted")):
        (tmp_path / name).mkdir()
        expedition = OneStep(tmp_path / name)
        calls = iter([False, True, True, True])
        if step:
            monkeypatch.setattr(expedition.explorer, "step", step)
        expedition.run(interrupted=lambda calls=calls: next(calls))
        assert expedition.report["exploration"] == {"ended": ended}


@pytest.mark.parametrize("failing", ["topology.json", "the end"])
def test_a_failure_costs_no_result_but_its_own(failing: str, tmp_path: Path) -> None:
    expedition = OneStep(tmp_path)

    def fail(path: Path | None = None) -> None:
        raise ZeroDivisionError

    if failing == "the end":
        expedition.diary.close = fail
    else:
        expedition.explorer.mapper.topological_map.save = fail
    with pytest.raises(ZeroDivisionError):
        expedition.run()
    assert {file.name for file in tmp_path.iterdir()} == (MAPS | REST) - {failing}
