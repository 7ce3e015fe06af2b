"""Goals, and failures on the way to them, in short simulated episodes in small rooms."""

import io
import json
import sys
import time
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.explorer import Step
from pipeline.progress import Progress
from pipeline.transforms import from_yaw
from sarsim import episode as episode_module
from sarsim.episode import Episode
from sarsim.scoring.coverage import Coverage
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot
from tests.sarsim.rooms import HOUSE, box, movable, room


class Diary:
    """An episode and the lines of its log; ``meddle`` is called between each step and the drive that follows."""

    def __init__(
        self, arena: str, folder: Path, meddle: Callable[[Episode, Step], object] = lambda *_: None, **config
    ):
        path = folder / "arena.xml"
        path.write_text(arena)
        self.lines: list[str] = []
        out = folder / "out"
        settings = {"labels": "truth", "detector": None, "out": out} | config
        self.episode = episode = Episode(EpisodeConfig(arena=str(path), **settings))
        log, drive = episode.recorder.log_message, episode.explorer.drive
        episode.recorder.log_message = lambda level, text: (self.lines.append(f"{level} {text}"), log(level, text))
        episode.explorer.drive = lambda step: (meddle(episode, step), drive(step))[1]
        assert episode.run()
        self.report = json.loads((out / "report.json").read_text())

    def said(self, text: str) -> bool:
        return any(text in line for line in self.lines)


def test_without_scores_the_robot_does_the_same_and_the_report_compares_nothing(tmp_path: Path) -> None:
    drives = []
    for scores in (True, False):
        (folder := tmp_path / str(scores)).mkdir()
        diary = Diary(room((-0.6, 1.4), (-0.8, 0.8)), folder, steps=1, scores=scores)
        drives.append((folder / "out" / "trajectory_estimated.tum").read_bytes())
        assert ("semantic_map" in diary.report) == ("explored_fraction" in diary.report["exploration"]) == scores
    assert drives[0] == drives[1]


def test_the_oracle_needs_scores(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--oracle"):
        Episode(EpisodeConfig(oracle=True, scores=False, out=tmp_path / "out"))


def test_a_late_failure_costs_no_result_but_its_own(tmp_path):
    path = tmp_path / "arena.xml"
    path.write_text(room((-1.0, 2.8), (-1.3, 1.3)))
    out = tmp_path / "out"
    episode = Episode(EpisodeConfig(arena=str(path), labels="truth", detector=None, out=out, steps=1))
    close = episode.recorder.close

    def fail_to_close() -> None:
        close()
        raise RuntimeError("the recording's disk is full")

    def no_score() -> dict:
        raise InputError("no score")

    episode.recorder.close, episode.score.figures = fail_to_close, no_score
    with pytest.raises(ExceptionGroup) as failed:
        episode.run()
    assert failed.group_contains(RuntimeError, match="disk is full")
    assert failed.group_contains(InputError, match="no score")
    maps = {"keyframes.npz", "metric_map.npz", "semantic_map.ply", "topology.json"}
    assert maps | {"trajectory_true.tum", "trajectory_estimated.tum"} <= {file.name for file in out.iterdir()}
    assert "metric_map" not in json.loads((out / "report.json").read_text())


def test_the_log_does_not_depend_on_how_fast_the_scores_are(tmp_path, monkeypatch):
    logs = []
    for name, delay in (("quick", 0.0), ("slow", 1.0)):
        see = Coverage.see
        monkeypatch.setattr(Coverage, "see", lambda *args, see=see, delay=delay: (time.sleep(delay), see(*args)))
        (tmp_path / name).mkdir()
        logs.append(Diary(room((-1.0, 2.8), (-1.3, 1.3)), tmp_path / name, steps=2).lines)
        monkeypatch.undo()
    assert len(logs[0]) >= 2
    assert logs[0] == logs[1]


def test_a_terminal_shows_the_progress_and_the_phases_of_the_end(tmp_path, monkeypatch):
    path = tmp_path / "arena.xml"
    path.write_text(room((-1.0, 2.8), (-1.3, 1.3)))
    shown: list[Progress] = []

    @contextmanager
    def terminal(place: str):
        yield shown.append

    monkeypatch.setattr(episode_module, "shown_run", terminal)
    stderr = io.StringIO()
    stderr.isatty = lambda: True
    monkeypatch.setattr(sys, "stderr", stderr)
    config = EpisodeConfig(arena=str(path), labels="truth", detector=None, steps=1)
    Episode(replace(config, out=tmp_path / "unseen")).run(show_progress=False)
    assert not shown
    Episode(replace(config, out=tmp_path / "seen")).run()
    first, explored, *phases = shown
    assert (first.fraction, explored.is_timed) == (None, False) and 0 <= explored.fraction < 1
    assert {phase.fraction for phase in phases} == {None} and len({phase.text for phase in phases}) >= 5


def test_a_refused_episode_closes_its_robot(tmp_path, monkeypatch):
    closed = []  # an OpenGL context that outlives OpenGL would end with a traceback
    close = SimulatedRobot.close
    monkeypatch.setattr(SimulatedRobot, "close", lambda robot: (closed.append(robot), close(robot)))
    with pytest.raises(InputError, match=r"keyframes\.npz"):
        Episode(EpisodeConfig(labels="truth", detector=None, map=tmp_path, out=tmp_path / "out"))
    assert len(closed) == 1


def test_a_default_folder_that_another_command_has_created_meanwhile_is_left_to_it(tmp_path, monkeypatch):
    (tmp_path / "arena.xml").write_text(HOUSE)
    config = EpisodeConfig(arena="arena.xml", labels="truth", detector=None)
    monkeypatch.chdir(tmp_path)
    taken, make_arena = Path("runs", "arena-0"), episode_module.make_arena
    monkeypatch.setattr(episode_module, "make_arena", lambda *args: (taken.mkdir(parents=True), make_arena(*args))[1])
    episode = Episode(config)
    episode.recorder.close()
    episode.robot.close()
    assert episode.config.folder == episode.parts.folder == Path("runs", "arena-0-2")
    assert not list(taken.iterdir())


def test_a_refused_episode_leaves_no_default_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def refuse(*_: object, **__: object) -> None:
        raise InputError("no window")

    monkeypatch.setattr(episode_module, "compose", refuse)
    with pytest.raises(InputError, match="no window"):
        Episode(EpisodeConfig(labels="truth", detector=None))
    assert not list(tmp_path.glob("runs/*"))


def test_goals_are_visited_or_refused_with_a_reason_and_the_robot_comes_home(tmp_path):
    goals = ((0.8, 0.5), (50.0, 0.0), (2.0, 0.4))
    diary = Diary(room((-1.0, 2.0), (-1.1, 1.1)), tmp_path, goals=goals, home=True, steps=1)
    task = diary.report["goals"]
    assert (task["given"], task["reached"]) == (3, 1)
    for reason in ("(50.00, 0.00) m", "(2.00, 0.40) m is in a"):
        assert any(reason in line for line in task["refused"]), task["refused"]
        assert diary.said(f"WARN the goal {reason}")
    assert diary.said("INFO reached the goal (0.80, 0.50) m")
    assert diary.said("INFO reached home")
    home = diary.report["home"]
    assert (home["given"], home["reached"], home["refused"], len(home["each"])) == (1, 1, [], 1)
    first = task["each"][0]
    assert 0.8 * first["shortest_m"] < first["way_m"] < 2 * first["shortest_m"] and first["time_s"] > 0
    end = diary.episode.robot.trajectory[-1].T_world_base[:2, 3]
    assert np.linalg.norm(end) < 0.2
    assert diary.report["navigation"]["collisions"] == 0


def test_a_goal_round_a_corner_is_reached_without_exploring(tmp_path):
    wall = box((1.2, 1.3), (-1.4, 0.3))
    diary = Diary(room((-1.3, 5.0), (-1.4, 1.4), wall), tmp_path, goals=((2.6, -0.8),), odometry="truth")
    (each,) = diary.report["goals"]["each"]
    assert diary.report["goals"]["reached"] == 1 and "ended" not in diary.report["exploration"]
    assert each["way_m"] < 1.5 * each["shortest_m"]
    assert diary.report["navigation"]["collisions"] == 0


def put_in_the_way(episode: Episode, step: Step) -> None:
    """Move the geom once 1.6 m along the first drive forward that is longer than that: an arc may lead there."""
    data = episode.robot.physics.data
    if step.plan and data.mocap_pos[0, 0] > 8:
        places = np.vstack([step.keyframe.T_map_base[:2, 3], step.plan.waypoints[:, :2]])
        for start, drive, backs in zip(places, np.diff(places, axis=0), step.plan.backwards, strict=False):
            if (length := np.linalg.norm(drive)) > 2 and not backs:
                data.mocap_pos[0, :2] = start + 1.6 * drive / length
                return


def test_the_robot_stops_before_what_was_put_in_its_way_and_drives_around(tmp_path):
    barrel = movable(box((-0.15, 0.15), (-0.15, 0.15), (0.0, 0.5), label=7))
    arena = room((-1.3, 5.0), (-1.4, 1.4), barrel)
    # With true odometry: with its own localisation the robot grazes the barrel in one run out of three.
    diary = Diary(arena, tmp_path, put_in_the_way, steps=1, goals=((3.0, 0.0),), odometry="truth")
    assert diary.said("ended: the path is blocked")
    assert diary.report["goals"]["reached"] == 1
    assert diary.report["navigation"]["collisions"] == 0
    assert diary.report["navigation"]["stuck"] == 0


def lift(episode: Episode, step: Step) -> None:
    """Carry the robot once to another room."""
    robot = episode.robot
    if step.plan and robot.trajectory[-1].T_world_base[0, 3] < 4:
        robot.robot.set_pose(robot.physics, np.array([8.0, 0.0, 0.0]), np.array([1.0, 0, 0, 0]))
        mujoco.mj_forward(robot.physics.model.ptr, robot.physics.data.ptr)


ENDS = box((6.7, 6.8), (-1.3, 1.3)), box((9.8, 9.9), (-1.3, 1.3))
OTHER_ROOM = room((-1.3, 2.5), (-1.3, 1.3), *ENDS)
CLOSED_ROOM = room((-1.3, 2.5), (-1.3, 1.3), *ENDS, box((6.8, 9.8), (-1.4, -1.3)), box((6.8, 9.8), (1.3, 1.4)))


def test_a_robot_that_was_lifted_and_is_given_its_place_drives_no_old_plan_and_says_so(tmp_path):
    diary = Diary(CLOSED_ROOM, tmp_path, lift, steps=3, home=True, odometry="truth")
    assert diary.said("ended: the robot was carried elsewhere")
    assert diary.said("WARN the robot was carried and set down at (8.00, 0.00) m")
    assert diary.said("WARN the goal (0.00, 0.00) m cannot be reached from")
    assert diary.report["navigation"]["kidnapped"] == 1
    assert diary.report["navigation"]["collisions"] == 0
    assert diary.report["navigation"]["distance_m"] < 8  # it looks at all walls of its new room
    assert diary.report["home"]["reached"] == 0


def test_a_robot_that_was_lifted_to_where_it_has_never_been_stays_and_says_so(tmp_path):
    """Its wheels do not notice the kidnapping, but its camera shows a room that its map does not have."""
    diary = Diary(OTHER_ROOM, tmp_path, lift, steps=8, home=True)
    assert diary.said("WARN the robot is lost and has stopped: the camera view does not match the map")
    assert "no other place" in diary.report["lost"]
    assert diary.report["localisation"]["relocalised"] == 0
    assert diary.report["navigation"]["collisions"] == 0
    assert diary.report["navigation"]["distance_m"] < 1
    assert "home" not in diary.report  # it has not set out


def misplace(episode: Episode, step: Step) -> None:
    """Shift the maps by 20 cm, whatever the localisation says."""
    episode.explorer.mapper.correct(from_yaw(0, 0.2, 0, 0) @ episode.explorer.mapper.keyframes.poses)


def test_maps_that_lie_wrong_are_corrected_and_the_log_says_so(tmp_path):
    diary = Diary(room((-1.3, 2.5), (-1.3, 1.3)), tmp_path, misplace, steps=1)
    assert diary.said("keyframes moved by up to 0.200 m and 0.")
    assert np.linalg.norm(diary.episode.explorer.mapper.keyframes.poses[0, :3, 3]) < 1e-3


def test_a_robot_shut_in_gives_up_and_says_why(tmp_path):
    """Its camera sees nothing so near, and slipping wheels would look like driving."""
    diary = Diary(room((-0.36, 0.36), (-0.36, 0.36)), tmp_path, goals=((2.0, 0.0),), explore=True, odometry="truth")
    assert diary.said("WARN the robot is lost and has stopped: up to")
    navigation = diary.report["navigation"]
    assert navigation["legs"] - navigation["reached"] <= 5
    assert "metric_map" not in diary.report
    assert diary.report["exploration"]["ended"] == "lost"
    assert [fault["kind"] for fault in diary.report["faults"]][-1] == "lost"


def test_a_robot_goes_on_in_the_map_of_an_earlier_episode(tmp_path):
    folders = [tmp_path / name for name in ("first", "second")]
    for folder in folders:
        folder.mkdir()
    first = Diary(HOUSE, folders[0], steps=2)
    earlier = folders[0] / "out"
    file = (earlier / "keyframes.npz").read_bytes()
    second = Diary(HOUSE, folders[1], map=earlier, start=(0.6, 0.3, 10.0), steps=1)
    mapper = second.episode.explorer.mapper
    assert second.report["localisation"]["relocalised"] == 1
    assert second.report["localisation"]["ate_rmse_m"] < 0.05
    known = mapper.keyframes
    assert known.loaded_count == len(first.episode.explorer.mapper.keyframes) < len(known)
    poses = first.episode.explorer.mapper.localisation.poses
    np.testing.assert_allclose(mapper.localisation.poses[: known.loaded_count], poses, atol=1e-3)
    explored = [diary.report["exploration"]["explored_fraction"] for diary in (first, second)]
    assert 0.3 < explored[0] < explored[1]
    assert second.report["metric_map"]["occupied_precision"] > 0.95
    assert second.report["semantic_map"]["accuracy"] > 0.98
    assert (earlier / "keyframes.npz").read_bytes() == file
