"""What points of a saved semantic map are, by rays through exact scenes."""

import mujoco
import numpy as np
import pytest

from pipeline.labels import Label
from scripts.benchmarks import semantic_confusion as confusion

SCENE = """<mujoco><size nuser_geom="1"/><worldbody>
<geom name="floor" type="plane" size="5 5 .1" user="2"/>
<geom name="barrel_7" type="cylinder" size=".3 .4" pos="2 0 .4" user="7"/>
<geom name="hidden_1" type="box" size=".2 .2 .2" pos="3 0 .2" user="1"/>
<geom name="hull_2" type="box" size=".1 .1 .1" pos="1 0 .5" group="3" user="1"/>
</worldbody></mujoco>"""


def test_rays_end_at_the_first_drawn_geom() -> None:
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    rays = np.array([(1.0, 0, 0), (1.0, 0, -0.5), (0, 0, 1.0)])
    geom, up = confusion.first_hits(model, data, np.array([0, 0, 0.5]), rays)
    assert [confusion.thing_of(model, g) if g >= 0 else None for g in geom] == ["barrel", "floor", None]
    assert up[:2] == pytest.approx([0, 1])


@pytest.mark.parametrize(
    ("tilt", "side"), [(0, "top"), (7, "top"), (15, "slope"), (90, "side"), (120, "slope"), (180, "bottom")]
)
def test_faces_have_sides(tilt: float, side: str) -> None:
    assert confusion.side_of(np.cos(np.deg2rad(tilt))) == side


def test_what_is_near_a_wall_is_counted_apart() -> None:
    points = np.array([(0, 0, 0), (0.05, 0, 0), (0.2, 0, 0)], np.float32)
    truth = np.array([Label.WALL, Label.TERRAIN, Label.TERRAIN], np.uint8)
    assert confusion.near_walls(points, truth).tolist() == [False, True, False]
    assert not confusion.near_walls(points[1:], truth[1:]).any()
