from datetime import datetime

import pytest

from pipeline.errors import InputError
from pipeline.plugins.league.brief import MissionBrief, Penalties, Rewards


def test_names_of_files():
    brief = MissionBrief(team="Team-1", name="lab", start=datetime(2026, 1, 26, 14, 30, 5))
    assert brief.map_2d_name == "RoboCup2026-Team_1-lab.tiff"
    assert brief.pois_name == "RoboCup2026-Team_1-lab-14-30-05-pois.csv"


@pytest.mark.parametrize("team", ["../../etc", "a/b", "..", 'x,"y"', "Ünï cöde"])
def test_no_name_leads_to_another_folder(team):
    stem = MissionBrief(team=team).stem
    assert not set('/\\,"\n') & set(stem) and ".." not in stem
    assert stem.count("-") == 2


@pytest.mark.parametrize(
    "wrong",
    [
        {"minutes": 0.0},
        {"minutes": float("nan")},
        {"team": " "},
        {"name": "a\nb"},
        {"tasks": ()},
        {"tasks": ("find", "find")},
        {"rewards": Rewards(beta=-1.0)},
        {"penalties": Penalties(contact=float("inf"))},
    ],
)
def test_what_cannot_be_is_refused(wrong):
    with pytest.raises(InputError, match=r"^mission: "):
        MissionBrief(**wrong)
