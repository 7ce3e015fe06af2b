"""Whole episodes, as the command runs them."""

import json
import shutil
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

from pipeline.explorer import Explorer
from pipeline.metric_map.io.npz import load_metric_map
from sarsim.commands import run_episode
from sarsim.episode import Episode
from sarsim.plugins.fiducials.plugin import FiducialsConfig
from sarsim.settings import WEIGHTS, EpisodeConfig
from tests.pipeline.victims.networks import darknet_files
from tests.sarsim.rooms import room
from tests.source_tree import ROOT

QUICK = ["--labels", "truth", "--detector", "None"]
"""No network has to be loaded."""


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """An arena in which an episode starts at once."""
    path = tmp_path_factory.mktemp("arena") / "small.xml"
    path.write_text(room((-0.6, 1.4), (-0.8, 0.8)))
    return path


@pytest.fixture(scope="module")
def report(episode):
    return json.loads((episode / "report.json").read_text())


def test_the_arena_is_explored_without_harm(report):
    navigation = report["navigation"]
    assert report["exploration"]["explored_fraction"] >= 0.95
    assert navigation["reached"] == navigation["legs"] > 0
    assert navigation["tipped"] == navigation["stuck"] == navigation["collisions"] == 0
    assert navigation["max_pitch_deg"] < 20
    assert report["steps"] <= 160


def test_the_maps_are_right(report):
    metric_map, topology = report["metric_map"], report["topological_map"]
    assert metric_map["occupied_recall"] >= 0.95
    assert metric_map["occupied_precision"] >= 0.97
    assert metric_map["false_free_rate"] <= 0.01
    assert (topology["components"], topology["edges_through_walls"]) == (1, 0)
    assert topology["coverage"] >= 0.9
    assert report["segments"]["angle_error_deg"]["median"] < 0.5
    assert report["segments"]["boxes_iou"]["median"] > 0.6
    assert report["semantic_map"]["accuracy"] > 0.9995


def test_the_robot_knows_where_it_is(report):
    localisation = report["localisation"]
    assert localisation["ate_rmse_m"] < 0.03
    assert localisation["heading_rmse_deg"] < 0.5
    assert localisation["drift_percent"] < 0.2
    assert localisation["keyframes"] > report["steps"]
    assert localisation["false_loops"] == localisation["relocalised"] == 0
    assert "lost" not in report


def test_every_file_reads_back(episode, report):
    assert len(load_metric_map(episode / "metric_map.npz").occupied_centres()) > 1000
    cloud = o3d.t.io.read_point_cloud(str(episode / "semantic_map.ply"))
    assert len(cloud.point.positions) == report["semantic_map"]["points"]
    assert set(np.unique(cloud.point["label"].numpy())) == {1, 2, 3, 4, 6}
    for name in ("trajectory_true.tum", "trajectory_estimated.tum"):
        rows = np.loadtxt(episode / name)
        assert rows.shape[1] == 8
        assert np.all(np.diff(rows[:, 0]) > 0)
    topology = json.loads((episode / "topology.json").read_text())
    assert len(topology["nodes"]) == report["topological_map"]["nodes"]
    assert (episode / "episode.rrd").read_bytes()[:4] == b"RRF2"
    assert (episode / "report.html").read_text().rstrip().endswith("</html>")
    assert not list(episode.glob("*.part"))


def test_the_report_has_the_agreed_names(episode, shared):
    check = [sys.executable, shared / "check_report.py", episode / "report.json"]
    assert subprocess.run(check, capture_output=True, text=True).stdout == ""


def short_report(out: Path, **changes: object) -> dict:
    assert Episode(EpisodeConfig(out=out, labels="truth", detector=None, **changes)).run()
    return json.loads((out / "report.json").read_text())


def test_a_robot_that_is_given_its_pose_makes_no_error_but_of_reading_tags_and_one_that_trusts_its_wheels_does(
    tmp_path, small
):
    given = short_report(tmp_path / "a", odometry="truth", plugins={"fiducials": FiducialsConfig(30)}, steps=2)
    drifting = short_report(tmp_path / "b", arena=str(small), localisation="odometry", steps=1)
    assert "victims" not in given
    error = given["localisation"]
    assert error.pop("keyframes") > 5
    assert 2 <= error.pop("fiducials_found") <= 30
    assert 0 < error.pop("fiducial_error_m") < 0.02
    assert max(error.values()) < 1e-9
    assert drifting["localisation"]["ate_rmse_m"] > 0
    assert drifting["localisation"]["loops"] == 0


def ended_in_step(number: int, ending: signal.Signals, monkeypatch) -> None:
    """Let a signal come while a step of the next episode is under way."""
    step, steps = Explorer.step, 0

    def interrupted_step(explorer):
        nonlocal steps
        steps += 1
        if steps == number:
            signal.raise_signal(ending)
        return step(explorer)

    monkeypatch.setattr(Explorer, "step", interrupted_step)


def test_ctrl_c_leaves_a_whole_recording_and_report(tmp_path, small, monkeypatch, capsys):
    ended_in_step(1, signal.SIGINT, monkeypatch)
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as stop:
        run_command(monkeypatch, *QUICK, "--arena", small, "--out", out)
    assert stop.value.code == 128 + signal.SIGINT
    assert json.loads((out / "report.json").read_text())["steps"] == 1
    assert (out / "episode.rrd").stat().st_size > 100_000
    assert str(out) in capsys.readouterr().out


@pytest.mark.skipif(not WEIGHTS.exists(), reason="no network has been trained")
def test_an_episode_with_networks_that_was_stopped_goes_on_bit_for_bit(tmp_path, monkeypatch, capsys):
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    files = darknet_files(tmp_path)
    flags = ("--steps", 2, "--detector", *files)
    run_command(monkeypatch, *flags, "--out", whole)
    ended_in_step(1, signal.SIGTERM, monkeypatch)
    with pytest.raises(SystemExit) as stop:
        run_command(monkeypatch, *flags, "--out", stopped)
    assert stop.value.code == 128 + signal.SIGTERM
    assert json.loads((stopped / "report.json").read_text())["steps"] == 1
    assert (stopped / "episode.rrd").stat().st_size > 100_000
    kept = len(list((stopped / "network_outputs").iterdir()))
    assert kept >= 2
    assert str(stopped) in capsys.readouterr().out
    run_command(monkeypatch, "--resume", stopped)
    assert f"reusing {kept} stored network outputs" in capsys.readouterr().out
    assert not (stopped / "network_outputs").exists() and not (whole / "network_outputs").exists()
    for name in ("keyframes.npz", "metric_map.npz", "topology.json", "trajectory_true.tum"):
        assert (stopped / name).read_bytes() == (whole / name).read_bytes(), name
    first, again = (json.loads((folder / "report.json").read_text()) for folder in (whole, stopped))
    for report in (first, again):
        for key in ("config", "wall_time_s", "real_time_factor", "timing_ms"):
            del report[key]
    assert first == again
    assert first["steps"] == first["victims"]["present"] == 2
    assert 0.6 < first["semantic_map"]["miou_four"] < 1
    assert first["segments"]["angle_error_deg"]["median"] < 1
    assert first["topological_map"]["edges_through_walls"] == 0


def test_sigterm_ends_the_page_and_leaves_the_report(tmp_path, small):
    flags = [*QUICK, "--view", "web", "--arena", small, "--out", tmp_path]
    program = ROOT / "scripts" / "run_episode.py"
    process = subprocess.Popen([sys.executable, program, *flags], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    page = process.stdout.readline().split()[-1]
    with urllib.request.urlopen(page) as answer:
        assert answer.status == 200
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=300) == 143
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(page)


def run_command(monkeypatch, *flags: object) -> None:
    monkeypatch.setattr(sys, "argv", ["run_episode.py", *map(str, flags)])
    run_episode.main()


def test_its_config_file_repeats_an_episode_in_another_folder_and_a_page_nobody_opened_ends_with_it(
    tmp_path, small, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    shutil.copy(small, "small.xml")
    flags = ("--arena", "small.xml", "--random.columns", 3, "--random.rows", 4)
    run_command(monkeypatch, *flags, *QUICK, "--steps", 1, "--seed", 5, "--sensor", "ideal", "--goals", 0, 0)
    first = tmp_path / "runs" / "small-5"
    run_command(monkeypatch, "--config", first / "config.yaml")
    capsys.readouterr()
    run_command(monkeypatch, "--config", first / "config.yaml", "--seed", "6", "--out", "other", "--view", "web")
    assert "http://127.0.0.1:" in capsys.readouterr().out.splitlines()[0]
    assert (tmp_path / "other" / "report.html").exists()
    reports = [
        json.loads((folder / "report.json").read_text())
        for folder in (first, tmp_path / "runs" / "small-5-2", tmp_path / "other")
    ]
    assert reports[0]["config"].pop("out") != reports[1]["config"].pop("out")
    for report in reports:
        for key in ("wall_time_s", "real_time_factor", "timing_ms"):
            del report[key]
    assert reports[0] == reports[1]
    assert reports[2]["config"]["seed"] == 6
    assert reports[2]["config"]["random"] == reports[0]["config"]["random"]
    assert reports[2]["localisation"] != reports[0]["localisation"]
