"""What is noticed only when the robot stands in its arena is still refused in one line, and leaves nothing behind."""

import pytest

from sarsim.commands import run_episode
from tests.refusal import refusal

ARENA = """<mujoco><size nuser_geom="1"/><worldbody><light pos="0 0 4"/><geom type="plane" size="3 3 .1" user="2"/>
<site name="start" pos="{}"/><geom type="box" size="0.05 3 .6" pos="2 0 .6" user="1"/></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("start", "flags"),
    [
        ("1.98 0 0", ()),  # in a wall
        ("0 0 40", ("--fiducials", "2")),  # in the air
    ],
)
def test_a_start_where_nothing_can_stand(start, flags, tmp_path, monkeypatch, capfd):
    (tmp_path / "wall.xml").write_text(ARENA.format(start))
    monkeypatch.chdir(tmp_path)
    chosen = ["--view", "none", "--detector", "None", "--labels", "rules", *flags]
    monkeypatch.setattr("sys.argv", ["run_episode.py", "--arena", "wall.xml", "--out", "results", *chosen])
    said = refusal(capfd, run_episode.main)
    assert "wall.xml" in said and "start" in said
    assert [path.name for path in tmp_path.iterdir()] == ["wall.xml"]
