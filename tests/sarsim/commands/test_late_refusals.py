"""What is noticed only when the robot stands in its arena is still refused in one line, and leaves nothing behind."""

import subprocess
import sys

import pytest

ARENA = """<mujoco><size nuser_geom="1"/><worldbody><light pos="0 0 4"/><geom type="plane" size="3 3 .1" user="2"/>
<site name="start" pos="{}"/><geom type="box" size="0.05 3 .6" pos="2 0 .6" user="1"/></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("start", "flags"),
    [
        ("1.98 0 0", ()),  # in a wall
        ("0 0 40", ("--fiducials", "2")),  # in the air
    ],
)
def test_a_start_where_nothing_can_stand(start, flags, tmp_path):
    arena, out = tmp_path / "wall.xml", tmp_path / "results"
    arena.write_text(ARENA.format(start))
    main = "from sarsim.commands.run_episode import main; main()"
    chosen = ("--view", "none", "--detector", "None", "--labels", "rules", *flags)
    line = [sys.executable, "-c", main, "--arena", str(arena), "--out", str(out), *chosen]
    ended = subprocess.run(line, capture_output=True, text=True, cwd=tmp_path, check=False)
    said = [text for text in ended.stderr.splitlines() if text and not text.startswith("compil")]
    assert ended.returncode == 2
    assert len(said) == 1 and "wall.xml" in said[0] and "start" in said[0], ended.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["wall.xml"]
