"""The commands about missions, and the files of missions."""

from datetime import datetime

import pytest

from pipeline.errors import InputError
from pipeline.missions.brief import MissionBrief
from sarsim.scripts.cli import guarded
from sarsim.scripts.score_mission import score_mission
from sarsim.scripts.settings import load_mission
from sarsim.scripts.validate_mission import validate_mission
from tests.pipeline.missions.handed_in_room import hand_in_room
from tests.scripts.refusal import refusal


def test_the_missions_that_are_here():
    assert load_mission("league") == MissionBrief(name="labyrinth")
    assert load_mission("virtual").tasks == ("explore", "find", "park")


def test_a_mission_is_a_file(tmp_path):
    path = tmp_path / "mission.yaml"
    path.write_text("team: A\nstart: 2026-02-03 04:05:06\nminutes: 5\ntasks: [home]\nrewards:\n  beta: 0.9\n")
    brief = load_mission(str(path))
    assert (brief.start, brief.minutes, brief.tasks) == (datetime(2026, 2, 3, 4, 5, 6), 5.0, ("home",))
    assert (brief.rewards.beta, brief.rewards.alpha) == (0.9, 1.0)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("wheels: 4", "unknown setting wheels"),
        ("rewards:\n  gold: 1", "unknown setting gold"),
        ("minutes: 0", "a clock must run"),
        ("minutes: soon", "does not fit"),
        ("tasks: [dance]", "does not fit"),
        ("start: noon", "does not fit"),
        ("[", "not readable YAML"),
    ],
)
def test_a_wrong_file_is_refused_in_a_line(tmp_path, capsys, text, fault):
    path = tmp_path / "mission.yaml"
    path.write_text(text)
    assert fault in refusal(capsys, guarded, lambda: load_mission(str(path)))


def test_what_is_accepted_ends_well_and_what_is_rejected_does_not(tmp_path, capsys):
    plan, _, _ = hand_in_room(tmp_path)
    validate_mission(tmp_path)
    assert capsys.readouterr().out == f"{tmp_path}: a judge would reject nothing\n"
    plan.rename(plan.with_name("map.tiff"))
    with pytest.raises(SystemExit) as ended:
        validate_mission(tmp_path)
    assert ended.value.code == 1
    assert capsys.readouterr().out == "map.tiff: must be named RoboCup[Year]-[Team]-[Mission].tiff\n"
    assert "No such file" in refusal(capsys, guarded, lambda: validate_mission(tmp_path / "none"))


def test_no_fewer_than_no_resets(tmp_path):
    with pytest.raises(InputError, match="at least 0"):
        score_mission(tmp_path, "nist_6x4", resets=-1)
