"""The exploration's benchmark: its runs, the figures of their reports, and that it continues where it stopped."""

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.grid_map import Grid
from sarsim.ground_truth.true_surface import GroundTruthSurface
from sarsim.settings import EpisodeConfig
from scripts.benchmarks import episodes, exploration
from scripts.benchmarks.episodes import GROUPS, Job, run_job, run_jobs
from scripts.benchmarks.exploration_table import RATIO, flat, group_figures, seen90_ratio
from scripts.benchmarks.settings import ExplorationSettings
from scripts.benchmarks.top_view import BAND, MOST_PIXELS, SEEN, UNSEEN, WALL, top_view
from tests.sarsim.dataset.small import InProcess


def report(explored=1.0, seen90=None, time=100.0, tipped=0, collisions=0):
    return {
        "arena": "a",
        "seed": 3,
        "version": "0",
        "config": {"steps": 9},
        "steps": 7,
        "sim_time_s": time,
        "timing_ms": {"sense": {"median": 5.0}},
        "navigation": {"legs": 4, "reached": 4, "tipped": tipped, "stuck": 0, "collisions": collisions},
        "exploration": {"explored_fraction": explored} | ({} if seen90 is None else {"t90_s": seen90}),
    }


def test_all_numbers_of_a_report_become_figures_but_not_its_settings():
    assert flat(report(seen90=40.0)) == {
        "steps": 7,
        "sim_time_s": 100,
        "timing_ms.sense.median": 5,
        "navigation.legs": 4,
        "navigation.reached": 4,
        "navigation.tipped": 0,
        "navigation.stuck": 0,
        "navigation.collisions": 0,
        "exploration.explored_fraction": 1,
        "exploration.t90_s": 40,
    }


def test_the_worst_is_the_lowest_of_what_should_be_high_and_the_highest_of_what_should_be_low():
    figures = group_figures([report(0.9, collisions=2), report(0.5, collisions=1), report(1.0, seen90=30.0)])
    key = "exploration.explored_fraction"
    assert figures[f"{key}.worst"] == 0.5
    assert figures[f"{key}.median"] == 0.9
    assert figures[f"{key}.mean"] == pytest.approx(0.8)
    assert figures["navigation.collisions.worst"] == 2
    assert figures["navigation.collisions.sum"] == 3
    assert figures["exploration.t90_s.mean"] == 30  # of the one run that has it


@pytest.mark.parametrize(
    ("ours", "theirs", "ratio"),
    [
        (report(seen90=30.0), report(seen90=60.0), 0.5),
        (report(seen90=30.0), report(time=90.0), None),  # they never did: nothing to compare with
        (report(time=50.0), report(seen90=25.0), 20.0),  # we never did: ten times our time
        (report(), report(), None),
    ],
)
def test_a_run_that_never_saw_enough_counts_against_us(ours, theirs, ratio):
    assert seen90_ratio(ours, theirs) == (None if ratio is None else pytest.approx(ratio))


def test_each_strategy_explores_the_agreed_arenas(tmp_path):
    for name in ("b.raf", "a.raf", "readme.txt"):
        (tmp_path / name).touch()
    everything = exploration.jobs_of(ExplorationSettings(raf=tmp_path))
    ours = [job for job in everything if job.strategy == "ours"]
    count = {group: sum(job.group == group for job in ours) for group in GROUPS}
    assert count == {"nist_6x4": 10, "esogu_52x15": 2, "raf": 2, "random": 30}
    assert all(int(job.config.arena.split(":")[1]) % 4 < 3 for job in ours if job.group == "random")
    assert [Path(job.config.arena).stem for job in ours if job.group == "raf"] == ["a", "b"]
    assert len({job.name for job in everything}) == len(everything) == 3 * len(ours)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ({"nist": -1}, "--nist -1:"),
        ({"workers": 0}, "--workers 0"),
        ({"raf": Path("/nowhere")}, "/nowhere"),
        ({"labels": "dgcnn", "weights": Path("/nowhere.safetensors")}, "/nowhere"),
        ({"nist": 0, "esogu": 0, "random": 0}, "no arena"),
    ],
)
def test_what_cannot_be_run_is_refused(flags, message):
    with pytest.raises(InputError, match=message):
        exploration.measure(ExplorationSettings(**flags))


def test_a_folder_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="--runs"):
        exploration.measure(ExplorationSettings(runs=tmp_path / "file" / "runs"))


@pytest.fixture
def pretended(monkeypatch):
    """Has jobs end at once; gives lists of names: started jobs, those to fail, those that see too little."""
    started: list[str] = []
    fails: list[str] = []
    slow: list[str] = []

    def run(job, folder):
        started.append(job.name)
        if job.name not in fails:
            seconds = None if job.name in slow else 40.0 if job.strategy == "ours" else 80.0
            content = report(0.95, seconds, collisions=job.config.seed)
            (folder / f"{job.name}.json").write_text(json.dumps({"settings": job.settings, "report": content}))
            (folder / f"{job.name}.png").write_bytes(b"picture")

    monkeypatch.setattr(episodes, "run_job", run)
    monkeypatch.setattr("gc.collect", lambda: 0)  # takes half a second a job
    monkeypatch.setattr(episodes, "make_engine", lambda workers: InProcess())
    return started, fails, slow


def few(**numbers):
    """Settings with as many arenas as said and no others."""
    return ExplorationSettings(**{"esogu": 0, "random": 0, "labels": "truth"} | numbers)


def test_figures_pictures_and_table(tmp_path, pretended):
    result = exploration.measure(few(nist=3, random=1, runs=tmp_path))
    figures = result.figures
    assert figures[RATIO] == figures[f"nist_6x4.{RATIO}.worst"] == 0.5
    assert figures["nist_6x4.runs"] == figures["nist_6x4.seen90_runs"] == 3
    assert figures["nist_6x4.navigation.legs.sum"] == 12
    assert figures["random.exploration.explored_fraction.mean"] == 0.95
    assert figures["nearest_frontier.nist_6x4.exploration.t90_s.median"] == 80
    assert "esogu_52x15.runs" not in figures
    worst = {"nist_6x4": ["ours-nist_6x4-2", "ours-nist_6x4-1"], "random": ["ours-random_0-0"]}
    assert result.details["worst"] == worst
    assert [picture.stem for picture in result.pictures] == [*worst["nist_6x4"], *worst["random"]]
    assert all(picture.read_bytes() == b"picture" for picture in result.pictures)
    assert [column.header for column in result.table.columns] == ["", "nist_6x4", "random"]


def test_a_baseline_that_never_saw_enough_is_named_instead_of_a_ratio(tmp_path, pretended):
    _, _, slow = pretended
    slow += ["nearest_frontier-nist_6x4-0", "nearest_frontier-random_0-0"]
    figures = exploration.measure(few(nist=2, random=1, runs=tmp_path)).figures
    assert figures["nearest_frontier.nist_6x4.seen90_runs"] == 1
    assert figures["nearest_frontier.random.seen90_runs"] == 0
    assert figures[f"nist_6x4.{RATIO}.pairs"] == figures[f"{RATIO}.pairs"] == 1
    assert f"random.{RATIO}.median" not in figures
    assert figures[RATIO] == 0.5


def test_it_goes_on_where_it_stopped(tmp_path, pretended):
    started, fails, _ = pretended
    flags = {"nist": 2, "runs": tmp_path, "baselines": False}
    fails.append("ours-nist_6x4-1")
    result = exploration.measure(few(**flags))
    assert result.details["failed"] == ["ours-nist_6x4-1"]
    assert result.figures["nist_6x4.failed"] == 1
    assert result.figures["nist_6x4.runs"] == 1
    fails.clear()
    assert exploration.measure(few(**flags)).figures["nist_6x4.failed"] == 0
    assert started == ["ours-nist_6x4-0", "ours-nist_6x4-1", "ours-nist_6x4-1"]


def test_results_of_other_settings_are_not_mixed_in(tmp_path, pretended):
    flags = {"nist": 1, "runs": tmp_path, "baselines": False}
    exploration.measure(few(**flags))
    with pytest.raises(InputError, match="other settings"):
        exploration.measure(few(**flags, lighting="dim"))


def test_a_broken_result_is_named(tmp_path, pretended):
    (tmp_path / "ours-nist_6x4-0.json").write_text("{")
    with pytest.raises(InputError, match=r"ours-nist_6x4-0\.json"):
        exploration.measure(few(nist=1, runs=tmp_path, baselines=False))


def test_a_job_leaves_its_report_and_its_picture(tmp_path):
    job = Job("nist_6x4", "nearest_frontier", EpisodeConfig(steps=1, labels="truth", detector=None))
    run_job(job, tmp_path)
    result = job.result(tmp_path)
    assert result["report"]["steps"] == 1
    assert 0 < result["report"]["exploration"]["explored_fraction"] < 0.5
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {f"nearest_frontier-nist_6x4-0.{kind}" for kind in ("json", "png", "log")}


def test_an_arena_without_a_start_is_left_out(tmp_path, monkeypatch):
    monkeypatch.setattr(episodes, "make_engine", lambda workers: InProcess())
    job = Job("raf", "ours", EpisodeConfig(arena=str(tmp_path / "none.raf"), labels="truth"))
    (result,) = run_jobs([job], tmp_path, 1)
    assert "none.raf" in result["left_out"]


def test_the_picture_shows_what_is_where():
    drivable = np.zeros((40, 20), bool)
    drivable[5:35, 5:15] = True
    seen = np.zeros_like(drivable)
    seen[5:20] = True
    walls = np.zeros_like(drivable)
    walls[0] = True
    surface = GroundTruthSurface(Grid(np.array([-20, 0]), 0.05, (40, 20)), np.zeros((40, 20)), drivable, walls)
    way = np.array([(-0.5, 0.5), (-0.4, 0.5)])
    picture = top_view(surface, seen, way, [np.array([0.5, 0.6])], [], "text")
    assert picture.shape == (20 * MOST_PIXELS + BAND, 40 * MOST_PIXELS, 3)

    def at(x, y):
        """The colour at a place in m."""
        return tuple(picture[round((1.0 - y) / 0.05 * MOST_PIXELS), round((x + 1) / 0.05 * MOST_PIXELS)])

    assert at(-0.98, 0.5) == WALL
    assert at(-0.7, 0.3) == SEEN
    assert at(0.7, 0.3) == UNSEEN
    assert at(0.5, 0.6) == (220, 0, 0)
