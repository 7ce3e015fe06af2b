"""A robot that stands before a wall: what its observers are told, and what is left whatever fails."""

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from pipeline.expedition import Expedition, ResultFolder
from pipeline.explorer import Explorer, Observer
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.mapper import Mapper
from pipeline.rerun.recorder import Recorder
from pipeline.semantic_map.classifier import TruthClassifier
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.still_robot import StillRobot

MAPS = {"keyframes.npz", "metric_map.npz", "semantic_map.ply", "topology.json"}
REST = {"trajectory_estimated.tum", "episode.rrd", "report.json", "report.html", "victims.json", "victims.csv"}


@dataclass(frozen=True)
class Settings:
    out: Path
    weights: tuple[Path, Path] = Path("a"), Path("b")


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
    """An expedition of one step."""

    def __init__(self, out: Path):
        explorer = Explorer(StillRobot(), Mapper(PIONEER, TruthClassifier()))
        self.diary = Diary()
        explorer.observers.append(self.diary)
        results = ResultFolder(Settings(out), out, "here", 7, explorer.mapper, Recorder(out / "episode.rrd"))
        trajectory = EstimatedTrajectory(explorer.mapper.localisation, [])
        super().__init__(explorer, results, trajectory, steps=1)

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
    assert report["config"] == {"out": str(tmp_path), "weights": ["a", "b"]}
    assert report["stage"] == {"figure": 1}


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
