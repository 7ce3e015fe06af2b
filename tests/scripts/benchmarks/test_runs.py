"""Episodes of benchmarks: which are run, that finished ones are not run again, and small ones of some subjects."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.semantic_map.classifier import TruthClassifier
from sarsim.settings import EpisodeConfig
from scripts.benchmarks import barn, correction, kidnappings, runs, worlds
from scripts.benchmarks.labelled_drives import drive_through
from scripts.benchmarks.runs import Job, jobs_of, run_episode, run_jobs
from scripts.benchmarks.semantic import accuracy
from scripts.benchmarks.settings import BarnSettings, CorrectionSettings, ExplorationSettings, WorldsSettings
from tests.sarsim.dataset.small import InProcess
from tests.sarsim.rooms import box, room

QUICK = {"labels": "truth", "detector": None}


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch):
    monkeypatch.setattr(runs, "make_engine", lambda workers: InProcess())


def test_arenas_are_explored_with_every_seed_and_belong_to_groups(tmp_path):
    for name in ("b.raf", "a.raf", "readme.txt"):
        (tmp_path / name).touch()
    given = ExplorationSettings(arenas=("random:3", str(tmp_path)), seeds=(0, 7), labels="truth")
    jobs = list(jobs_of(given.episode, given))
    places = [("random", "random:3"), ("raf", str(tmp_path / "a.raf")), ("raf", str(tmp_path / "b.raf"))]
    assert [(job.group, job.config.arena) for job in jobs] == [place for place in places for _ in range(2)]
    assert len({job.name for job in jobs}) == 6 and {job.config.seed for job in jobs} == {0, 7}


def test_it_goes_on_where_it_stopped_but_not_with_other_settings(tmp_path):
    settings = ExplorationSettings(runs=tmp_path, labels="truth")
    jobs = [Job("random", EpisodeConfig(arena="random:0", seed=seed)) for seed in (0, 1)]
    started, failing = [], [1]

    def run(job):
        started.append(job.config.seed)
        assert job.config.seed not in failing
        return {"report": {"n": job.config.seed}}

    results = run_jobs(jobs, settings, run)
    assert results[0]["report"] == {"n": 0} and results[1] is None and runs.failures(jobs, results) == [jobs[1].name]
    failing.clear()
    assert run_jobs(jobs, settings, run)[1]["report"] == {"n": 1}
    assert started == [0, 1, 1]
    with pytest.raises(InputError, match="other settings"):
        run_jobs([Job("random", EpisodeConfig(arena="random:0", steps=3))], settings, run)
    (tmp_path / f"{jobs[0].name}.json").write_text("{")
    with pytest.raises(InputError, match=jobs[0].name):
        run_jobs(jobs, settings, run)


def test_the_log_of_a_job_whose_worker_died_says_so(tmp_path, monkeypatch):
    def dying(work, jobs, lock):
        for job in jobs:
            (lock.folder / f"{job.name}.log").write_text("a warning\n")
            yield job, None, InputError("3 worker processes died")

    monkeypatch.setattr(runs, "make_engine", lambda workers: dying)
    job = Job("random", EpisodeConfig(arena="random:0"))
    assert run_jobs([job], ExplorationSettings(runs=tmp_path, labels="truth"), lambda job: {}) == [None]
    assert (tmp_path / f"{job.name}.log").read_text() == "a warning\n3 worker processes died\n"


def test_an_episode_has_a_report_and_an_arena_without_a_start_is_left_out(tmp_path):
    job = Job("nist_6x4", EpisodeConfig(steps=1, exploration="nearest_frontier", **QUICK))
    result = run_episode(job, pages=tmp_path)
    assert result["report"]["steps"] == 1
    assert "nist_6x4" in (tmp_path / f"{job.name}.html").read_text()
    assert 0 < result["report"]["exploration"]["explored_fraction"] < 0.5
    result = run_episode(Job("raf", EpisodeConfig(arena=str(tmp_path / "none.raf"), **QUICK)))
    assert "none.raf" in result["left_out"]


def write_barn_world(folder, *posts):
    """World 0, with posts in the corners and elsewhere, and its path."""
    plane = "<geometry><plane><normal>0 0 1</normal><size>100 100</size></plane></geometry>"
    post = "<geometry><cylinder><radius>0.075</radius><length>1</length></cylinder></geometry>"
    places = [(-4.5, 0.0), (0.0, 0.0), (-4.5, 9.5), (0.0, 9.5), *posts]
    solids = [("0 0 0", plane), *((f"{x} {y} 0.5", post) for x, y in places)]
    models = [
        f"<model name='m{n}'><static>1</static><pose>{place} 0 0 0</pose><link name='link'>"
        f"<collision name='c'>{shape}</collision></link></model>"
        for n, (place, shape) in enumerate(solids)
    ]
    (folder / "world_0.world").write_text(f"<sdf version='1.6'><world name='w'>{''.join(models)}</world></sdf>")
    np.save(folder / "path_0.npy", np.array([[15, 0], [15, 30]]))


def test_a_barn_run_ends_with_the_clock_and_is_not_repeated(tmp_path, monkeypatch):
    monkeypatch.setattr(barn, "TIME_LIMIT", 2.0)
    write_barn_world(tmp_path, (-3.5, 5.0), (-1.0, 6.0))
    settings = BarnSettings(worlds=tmp_path, seeds=1, runs=tmp_path / "runs")
    result = barn.measure(settings)
    (run,) = result.details["runs"]["world_0"]
    assert run["ended"] == "time" and run["collisions"] == 0
    assert run["seconds"] <= 2.1 and run["distance_m"] < 4
    assert result.figures["worlds"] == 1 and result.figures["success"] == result.figures["score.mean"] == 0
    monkeypatch.setattr(barn, "Crossing", None)
    assert barn.measure(settings).figures == result.figures


def test_the_challenges_own_worlds_have_paths(shared):
    times = barn.worlds_in(shared / "barn")
    assert len(times) == 20
    assert all(5.0 < seconds < 10.0 for seconds in times.values())


def test_a_mission_in_a_world_of_others(tmp_path, monkeypatch):
    monkeypatch.setattr(worlds, "MINUTES", 0.05)
    (tmp_path / "hall.world").write_text(
        "<sdf version='1.6'><world name='hall'><model name='ground'><link name='l'><collision name='c'>"
        "<pose>0 0 -0.1 0 0 0</pose><geometry><box><size>6 5 0.2</size></box></geometry></collision></link></model>"
        "<model name='victim_hot'><pose>2 1 0 0 0 0</pose><link name='l'><visual name='v'><pose>0 0 0.2 0 0 0</pose>"
        "<geometry><box><size>1.6 0.4 0.3</size></box></geometry></visual></link></model></world></sdf>"
    )
    job = worlds.job_of(WorldsSettings(worlds=tmp_path), tmp_path / "hall.world")
    found = worlds.figures(worlds.run_job(job))
    assert found["victims"] == 1
    assert 0 < found["explored_m2"] <= found["ground_m2"] < 30
    assert 0.05 <= found["minutes"] < 0.15
    assert "score" in found


def test_a_robot_that_is_carried_finds_its_place_and_the_map_is_made_once(tmp_path, monkeypatch):
    arena, folder = tmp_path / "arena.xml", tmp_path / "episode"
    arena.write_text(room((-1.0, 2.2), (-1.0, 1.4), box((1.2, 1.3), (-1.0, -0.4))))
    config = EpisodeConfig(arena=str(arena), steps=2, **QUICK)
    counts = kidnappings.kidnap(config, 1, folder)
    assert counts.total() == 1 and counts["found"] + counts["found_worse"] == 1
    made = (folder / "keyframes.npz").stat().st_mtime_ns
    monkeypatch.setattr(kidnappings, "new_explorer", lambda *given: None)
    kidnappings.kidnap(config, 0, folder)
    assert (folder / "keyframes.npz").stat().st_mtime_ns == made


def test_corrected_maps_are_those_made_from_scratch(monkeypatch):
    monkeypatch.setattr(correction, "DRIVES", {"nist_6x4": 12})
    figures = correction.measure(CorrectionSettings(rounds=2)).figures
    assert figures["equal"] == 1
    assert 0 < figures["12.correction_s.median"] <= figures["12.correction_s.p95"]


def test_the_truth_is_right_and_the_rules_are_not_quite():
    figures = accuracy(list(drive_through("nist_6x4", 2, seed=0)), TruthClassifier())
    assert figures["network"]["miou_four"] == figures["fused"]["miou_four"] == 1
    assert 0.4 < figures["baseline"]["miou_four"] < 1
