import re
from dataclasses import replace

import numpy as np
import pytest

from pipeline.plugins.league.pois import points_of_interest, read_pois, write_pois
from tests.pipeline.plugins.league.handed_in_room import BRIEF, FINDS, T_MAP_LEAGUE, found, room_pois

TEXT = """\
"pois"
"1.3"
"Team, 'B'"
"Côte ""d'Or\"""
"2026-01-26"
"14:30:00"
"lab"
detection,time,type,name,x,y,z,robot,mode
1,14:30:08,"hazmat_sign","poison",-1.00,-1.25,0.30,"robot1",A
2,14:30:10,"ar_code","12",-1.00,0.75,0.30,"robot1",A
3,14:30:20,"heat_sig","heat",1.00,0.75,0.20,"robot1",A
4,14:30:20,"real_object","victim",1.00,0.75,0.20,"robot1",A
"""


@pytest.fixture
def path(tmp_path):
    write_pois(tmp_path / "pois.csv", BRIEF, room_pois())
    return tmp_path / "pois.csv"


def test_a_list_is_as_the_league_has_it_with_each_object_once(path):
    assert path.read_text() == TEXT


def test_what_is_written_is_read(path):
    read = read_pois(path)
    assert read.errors == []
    assert (read.header["team"], read.header["country"]) == (BRIEF.team, BRIEF.country)
    for a, b in zip(read.pois, room_pois(), strict=True):
        assert (a.time, a.type, a.name, a.robot, a.mode) == (b.time, b.type, b.name, b.robot, b.mode)
        np.testing.assert_allclose(a.position, b.position, atol=0.0051)


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('"pois"', "pois", "line 1"),
        ('"1.3"', '"1.2"', 'line 2: .*"1.3"'),
        ("2026-01-26", "26.1.2026", "line 5: .*2026-01-26, not '26.1.2026'"),
        ('"14:30:00"', '"14:30"', "line 6"),
        ('"lab"', '""', "line 7: .*mission"),
        ("detection,time", "id,time", "line 8"),
        ("1,14:30:08", "7,14:30:08", "line 9: detection = 7: must be 1"),
        ("14:30:08", "14:61:08", "line 9: time = 14:61:08"),
        ('"ar_code"', '"tag"', "line 10: type = 'tag'"),
        ('"12"', "12", "line 10: .*detection,time"),
        ('"12",-1.00', '"a"b",-1.00', "line 10: .*detection,time"),
        ("0.75,0.30", "nan,0.30", "line 10: .*detection,time"),
        ('0.20,"robot1",A', '0.20,"robot1",X', "line 11: mode = 'X'"),
        ('"ar_code","12",-1.00,0.75', '"hazmat_sign","poison",-1.00,-1.05', "line 10: hazmat_sign 'poison'"),
    ],
)
def test_faults_are_reported_line_by_line(path, old, new, fault):
    path.write_text(TEXT.replace(old, new, 1))
    (line,) = read_pois(path).errors
    assert re.match(fault, line)


def test_a_list_that_ends_in_its_header_is_refused(path):
    path.write_text('"pois"\n')
    (line,) = read_pois(path).errors
    assert "lines in the file: 1" in line


def test_a_find_of_an_earlier_run_was_found_at_the_start():
    earlier = found("heat", "", [0.0, 1.0, 0.2], np.nan, 0.9)
    (poi,) = points_of_interest([earlier], T_MAP_LEAGUE, BRIEF.start)
    assert poi.time == "14:30:00"


@pytest.mark.parametrize("apart", [0.2951, 0.2999, 0.3001, 0.3049])
def test_no_list_of_ones_own_has_an_object_twice_once_it_is_rounded(tmp_path, apart):
    finds = [replace(FINDS[1], position=np.array([x, 1.0, 0.3])) for x in (-1.0021, -1.0021 - apart)]
    write_pois(tmp_path / "pois.csv", BRIEF, points_of_interest(finds, T_MAP_LEAGUE, BRIEF.start))
    assert read_pois(tmp_path / "pois.csv").errors == []


def test_times_begin_with_the_run_and_go_on_past_midnight():
    finds = [found("heat", "", [x, 1.0, 0.2], time, 0.9) for x, time in ((0.0, 1000.0 + 36000), (2.0, 1060.0))]
    pois = points_of_interest(finds, T_MAP_LEAGUE, BRIEF.start, 1000.0)
    assert [poi.time for poi in pois] == ["14:31:00", "00:30:00"]
