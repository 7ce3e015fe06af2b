"""Rules for arenas of others: which are broken is said in one line."""

import re
from pathlib import Path

import pytest

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena

ROOM = '<mujoco>{}<worldbody><site name="start"/><geom type="plane" size="5 5 1" user="2"/>{}</worldbody></mujoco>'
BOX = '<geom type="box" size="0.02 0.5 1" user="7"/>'


def room(folder: Path, settings: str, more: str) -> str:
    (folder / "room.xml").write_text(ROOM.format(settings, more))
    return str(folder / "room.xml")


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (f'<body name="wall" pos="2 0 1">{BOX}</body>', ""),
        (f'<body name="door" pos="2 0 1"><joint axis="0 0 1"/>{BOX}</body>', "can move, .*: door$"),
        (f'<body name="crate" pos="2 0 1"><freejoint/>{BOX}</body>', "can move, .*: crate$"),
        (f'<body pos="2 0 1"><joint/><body name="leaf">{BOX}</body></body>', "can move, .*: number 1, leaf$"),
        (BOX.replace(' user="7"', ' pos="2 0 1"'), "1 of 2 shapes have no label"),
    ],
)
def test_what_moves_or_has_no_label_is_said(more: str, said: str, tmp_path: Path, caplog) -> None:
    load_arena(room(tmp_path, "", more))
    assert [line for line in caplog.messages if not said] == []
    if said:
        (line,) = caplog.messages
        assert re.search(said, line)


@pytest.mark.parametrize(
    ("gravity", "is_good"), [("0 0 9.81", False), ("0 0 0", False), ("5 0 -9", False), ("0 0 -1.6", True)]
)
def test_gravity_points_downwards(gravity: str, is_good: bool, tmp_path: Path) -> None:
    path = room(tmp_path, f'<option gravity="{gravity}"/>', "")
    if is_good:
        load_arena(path)
    else:
        with pytest.raises(InputError, match=r"room.xml: gravity .* downwards"):
            load_arena(path)


@pytest.mark.parametrize(
    ("floor", "said"),
    [
        ("", "no shape can collide"),
        ('<geom type="plane" size="5 5 1" user="2" contype="0" conaffinity="0"/>', "no shape can collide"),
        ('<geom type="plane" size="5 5 1" user="2" group="3"/>', "no shape is visible"),
        ('<geom type="plane" size="5 5 1" user="2" rgba="1 1 1 0"/>', "no shape is visible"),
    ],
)
def test_a_floor_carries_the_robot_and_is_seen(floor: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "room.xml").write_text(f'<mujoco><worldbody><site name="start"/>{floor}</worldbody></mujoco>')
    with pytest.raises(InputError, match=rf"room.xml: {said}"):
        load_arena(str(tmp_path / "room.xml"))
