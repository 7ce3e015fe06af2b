"""BARN's worlds: which are run, how a run ends, and what is counted."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from pipeline.errors import InputError
from pipeline.robot import Velocity
from pipeline.run import TimeIsUpError
from sarsim.scoring import barn as rules
from sarsim.scoring.barn import optimal_seconds
from scripts import benchmark
from scripts.benchmarks.barn import Crossing, figures, jobs_of, measure, run_job, table, worlds_in
from scripts.benchmarks.settings import BarnSettings
from tests.refusal import refusal

PLANE = (
    "<model name='ground'><static>1</static><link name='link'><collision name='c'><geometry><plane>"
    "<normal>0 0 1</normal><size>100 100</size></plane></geometry></collision></link></model>"
)
PATH = np.array([[15, 0], [15, 30]])


def cylinder(name: str, x: float, y: float) -> str:
    """A post like BARN's, m."""
    return (
        f"<model name='{name}'><static>1</static><pose>{x} {y} 0.5 0 0 0</pose><link name='link'><collision name='c'>"
        "<geometry><cylinder><radius>0.075</radius><length>1</length></cylinder></geometry></collision></link></model>"
    )


def write_world(folder: Path, number: int, *posts: tuple[float, float]) -> None:
    """Write a world with posts, besides those in the corners, and its path."""
    corners = [(-4.5, 0.0), (0.0, 0.0), (-4.5, 9.5), (0.0, 9.5)]
    models = [cylinder(f"post_{n}", *place) for n, place in enumerate([*corners, *posts])]
    world = f"<sdf version='1.6'><world name='default'>{PLANE}{''.join(models)}</world></sdf>"
    (folder / f"world_{number}.world").write_text(world)
    np.save(folder / f"path_{number}.npy", PATH)


@contextmanager
def crossing(folder: Path, out: Path) -> Iterator[Crossing]:
    """A robot in world 0 of a folder."""
    made = Crossing(jobs_of(BarnSettings(worlds=folder), "world_0")[0].config, out)
    yield made
    made.episode.robot.close()


def drive_on(run: Crossing, v: float, seconds: float) -> bool:
    """Whether the run goes on after so many s straight ahead."""
    robot = run.episode.robot
    for _ in range(round(seconds / robot.control_period)):
        try:
            run.on_motion(robot.drive(Velocity(v)))
        except TimeIsUpError:
            return False
    return True


def test_worlds_are_those_of_the_folder_by_number(tmp_path: Path) -> None:
    for number in (15, 105, 9):
        write_world(tmp_path, number)
    (tmp_path / "world_x.world").touch()
    assert list(worlds_in(tmp_path)) == ["world_9", "world_15", "world_105"]
    assert set(worlds_in(tmp_path).values()) == {optimal_seconds(PATH)}


def test_each_world_is_crossed_once_for_each_seed_from_the_same_start() -> None:
    configs = [job.config for job in jobs_of(BarnSettings(worlds=Path("barn"), seeds=2), "world_3")]
    assert [config.seed for config in configs] == [0, 1]
    assert {(c.arena, c.start, c.goals, c.robot, c.odometry) for c in configs} == {
        ("barn/world_3.world", (-2.25, 3.0, 90.0), ((-2.25, 13.0),), "jackal", "wheel")
    }


def test_a_robot_that_drives_straight_across_an_open_world_has_arrived(tmp_path: Path) -> None:
    write_world(tmp_path, 0)
    with crossing(tmp_path, tmp_path / "out") as run:
        assert drive_on(run, 0.0, 1.0)
        assert not drive_on(run, 2.0, 12.0)
        y = run.episode.robot.trajectory[-1].T_world_base[1, 3]
        assert run.judge.ended == "reached" and 11.99 < y < 12.1
        assert 4.5 < run.judge.seconds < 10  # 9 m at no more than 2 m/s


def test_a_robot_that_touches_a_post_has_failed(tmp_path: Path) -> None:
    write_world(tmp_path, 0, (-2.25, 4.0))
    with crossing(tmp_path, tmp_path / "out") as run:
        assert not drive_on(run, 0.5, 6.0)
        assert run.judge.ended == "contact"
        assert run.episode.robot.trajectory[-1].T_world_base[1, 3] < 4.0


def test_a_run_ends_with_the_clock_and_what_is_done_is_not_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rules, "LIMIT", 2.0)
    write_world(tmp_path, 0, (-3.5, 5.0), (-1.0, 6.0))
    settings = BarnSettings(worlds=tmp_path, seeds=1, runs=tmp_path / "runs")
    settings.runs.mkdir()
    run_job(jobs_of(settings, "world_0")[0], settings.runs)
    result = measure(settings)
    (run,) = result.details["runs"]["world_0"]
    assert run["ended"] == "time" and run["collisions"] == 0
    assert run["seconds"] <= 2.1 and run["distance_m"] < 4
    assert result.figures["worlds"] == 1 and result.figures["success"] == result.figures["score.mean"] == 0


def test_figures_of_runs() -> None:
    reached, touched = {"ended": "reached", "seconds": 20.0}, {"ended": "contact", "seconds": 3.0}
    slow, late = {"ended": "reached", "seconds": 90.0}, {"ended": "time", "seconds": 100.0}
    found = figures({"world_1": [reached, touched], "world_2": [slow, late]}, {"world_1": 5.0, "world_2": 6.0})
    assert (found["worlds"], found["success"], found["contacts"]) == (2, 0.5, 0.25)
    assert (found["world_1.success"], found["world_1.time_s"], found["world_1.score"]) == (0.5, 20.0, 0.125)
    assert (found["world_2.time_s"], found["world_2.score"]) == (90.0, 0.0625)
    assert found["score.mean"] == pytest.approx(0.375 / 4)
    assert 0 <= found["score.low"] < found["score.mean"] < found["score.high"] <= 0.25


def test_a_world_that_nobody_crosses_has_no_time_and_the_table_says_how_runs_ended() -> None:
    runs = {"world_7": [{"ended": "contact", "seconds": 3.0}, {"ended": "given_up", "seconds": 0.0}]}
    found = figures(runs, {"world_7": 5.0})
    assert "world_7.time_s" not in found and found["score.mean"] == found["score.high"] == 0
    out = io.StringIO()
    Console(file=out, width=120).print(table(runs, found))
    row = next(line for line in out.getvalue().splitlines() if "world_7" in line)
    assert "0/2" in row and "1 contact, 1 given_up" in row


@pytest.mark.parametrize("lacks", ["worlds", "path", "folder"])
def test_a_folder_without_worlds_or_paths_is_refused_in_one_line(
    lacks: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, runs = tmp_path / "barn", tmp_path / "runs"
    if lacks != "folder":
        folder.mkdir()
    if lacks == "path":
        write_world(folder, 4)
        (folder / "path_4.npy").unlink()
    monkeypatch.setattr("sys.argv", ["benchmark.py", "barn", "--worlds", str(folder), "--runs", str(runs)])
    said = refusal(capsys, benchmark.main)
    assert str(folder) in said and ("path_4.npy" in said) == (lacks == "path")
    assert not runs.exists()


@pytest.mark.parametrize(
    ("settings", "flag"),
    [
        ({"seeds": 0}, "--seeds 0"),
        ({"workers": 0}, "--workers 0"),
        ({"speed": 0.0}, "--speed 0"),
        ({"speed": float("nan")}, "--speed nan"),
        ({"robot": "none.xml"}, "--robot none.xml"),
    ],
)
def test_bad_settings_are_refused(settings: dict[str, float], flag: str, tmp_path: Path) -> None:
    write_world(tmp_path, 0)
    runs = tmp_path / "runs"
    with pytest.raises(InputError, match=flag):
        measure(BarnSettings(worlds=tmp_path, runs=runs, **settings))
    assert not runs.exists()


def test_the_challenges_own_worlds_have_paths(shared: Path) -> None:
    times = worlds_in(shared / "barn")
    assert len(times) == 20
    assert all(5.0 < seconds < 10.0 for seconds in times.values())
