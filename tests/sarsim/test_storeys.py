"""Worlds whose ground is not at z = 0: a storey of a building, a basement."""

import json

import numpy as np
import pytest

from pipeline.map_file import KEYFRAMES, load_elevation_map
from sarsim.commands.run_episode import run_episode
from sarsim.robots.model import robot_model
from sarsim.settings import EpisodeConfig

ROOM = """<mujoco><size nuser_geom="1"/><worldbody><frame pos="0 0 {}"><light pos="0 0 4"/>
<geom type="plane" size="4 4 .1" user="2"/><site name="start" pos="-1 0 0"/>
<geom type="box" size="3 .05 .6" pos="0 3 .6" user="1"/><geom type="box" size="3 .05 .6" pos="0 -3 .6" user="1"/>
<geom type="box" size=".05 3 .6" pos="3 0 .6" user="1"/><geom type="box" size=".05 3 .6" pos="-3 0 .6" user="1"/>
<geom type="box" size=".3 .3 .1" pos="2 1 .1" user="4"/></frame></worldbody></mujoco>"""


def mapped(folder, z):
    """Report of a first drive in the room at a height, and the heights of its ground above that, m."""
    arena, out = folder / "arena.xml", folder / "out"
    arena.write_text(ROOM.format(z))
    run_episode(EpisodeConfig(arena=str(arena), labels="rules", detector=None, steps=1, out=out))
    ground = load_elevation_map(out / KEYFRAMES, robot_model())[0].measured - z
    return json.loads((out / "report.json").read_text()), ground


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    return mapped(tmp_path_factory.mktemp("level"), 0.0)


@pytest.mark.parametrize("height", [3.0, -7.31])
def test_heights_count_from_where_the_robot_starts(height, level, tmp_path):
    reports, ground = zip(level, mapped(tmp_path, height), strict=True)
    for section, number in (("semantic_map", "accuracy"), ("metric_map", "occupied_recall")):
        assert reports[1][section][number] == pytest.approx(reports[0][section][number], abs=0.03)
    areas = [np.count_nonzero(np.isfinite(g)) for g in ground]
    assert areas[1] == pytest.approx(areas[0], rel=0.03)
    assert [np.nanmedian(g) for g in ground] == pytest.approx([0.0, 0.0], abs=0.01)
