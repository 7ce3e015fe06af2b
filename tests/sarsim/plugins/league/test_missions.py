"""The commands about missions, and the files of missions."""

import json
from datetime import datetime

import pytest

from pipeline.plugins.league.brief import MissionBrief
from pipeline.plugins.league.validation import validate
from sarsim.commands.run_episode import run_episode
from sarsim.commands.settings import run_with_settings
from sarsim.methods.plugins import make_plugins
from sarsim.plugins.league.plugin import load_mission
from sarsim.plugins.league.score_mission import score_mission
from sarsim.plugins.league.validate_mission import MissionValidation, validate_mission
from sarsim.settings import EpisodeConfig
from tests.pipeline.plugins.league.handed_in_room import hand_in_room


def test_the_missions_that_are_here():
    assert load_mission("league") == MissionBrief(name="labyrinth")
    assert load_mission("virtual").tasks == ("explore", "find", "park")


def test_a_mission_is_a_file(tmp_path):
    path = tmp_path / "mission.yaml"
    path.write_text("team: A\nstart: 2026-02-03 04:05:06\nminutes: 5\ntasks: [home]\nrewards:\n  beta: 0.9\n")
    brief = load_mission(str(path))
    assert (brief.start, brief.minutes, brief.tasks) == (datetime(2026, 2, 3, 4, 5, 6), 5.0, ("home",))
    assert (brief.rewards.beta, brief.rewards.alpha) == (0.9, 1.0)


def test_flags_change_the_clock_and_what_counts():
    assert make_plugins(EpisodeConfig()) == []
    finds, mission = make_plugins(EpisodeConfig(mission="virtual", minutes=3.0, home=True))
    assert (finds.name, mission.name) == ("finds", "league")
    assert (mission.brief.minutes, mission.brief.tasks) == (3.0, ("explore", "find", "park", "home"))
    assert make_plugins(EpisodeConfig(mission="league"))[1].brief == load_mission("league")


def test_an_episode_plays_a_mission_and_is_scored(tmp_path, capsys):
    out = tmp_path / "out"
    flags = ["--mission", "league", "--minutes", "0.05", "--labels", "truth", "--detector", "None", "--home"]
    run_with_settings(run_episode, EpisodeConfig, ["--out", str(out), *flags])
    report = json.loads((out / "report.json").read_text())
    assert report["exploration"]["ended"] == "time"
    assert report["home"]["reached"] == 1
    assert report["sim_time_s"] <= 3.1
    assert validate(out) == []
    for league in ("league", "virtual"):
        assert {"points"} <= set().union(*report[league].values())
    capsys.readouterr()
    score_mission(out, "nist_6x4")
    again = json.loads(capsys.readouterr().out)
    for league in ("league", "virtual"):
        for rule, figures in report[league].items():
            assert again[league][rule] == pytest.approx(figures), rule


def test_what_is_accepted_ends_well_and_what_is_rejected_does_not(tmp_path, capsys):
    plan, _, _ = hand_in_room(tmp_path)
    validate_mission(MissionValidation(path=tmp_path))
    assert capsys.readouterr().out == f"{tmp_path}: all files are valid\n"
    plan.rename(plan.with_name("map.tiff"))
    with pytest.raises(SystemExit) as ended:
        validate_mission(MissionValidation(path=tmp_path))
    assert ended.value.code == 1
    assert capsys.readouterr().out == "map.tiff: must be named RoboCup[Year]-[Team]-[Mission].tiff\n"
