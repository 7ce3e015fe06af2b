"""A block on a rail that is pushed against a wall."""

import mujoco
import pytest

from pipeline.labels import Label
from sarsim.ground_truth.contacts import CHATTER, CollisionCounter

WORLD = """
<mujoco>
  <option gravity="0 0 0"/>
  <size nuser_geom="1"/>
  <worldbody>
    <geom type="box" size=".1 1 1" pos="1.2 0 0" user="{label:d}"/>
    <body name="robot">
      <joint type="slide" axis="1 0 0"/>
      <geom type="box" size=".1 .1 .1" user="0"/>
    </body>
  </worldbody>
</mujoco>
"""


def collisions(places: list[float], label: Label = Label.WALL, pause: float = 0.0) -> int:
    """With the robot at each of these places along its rail, one after the other."""
    model = mujoco.MjModel.from_xml_string(WORLD.format(label=label))
    data = mujoco.MjData(model)
    counter = CollisionCounter(model, model.body("robot").id)
    for place in places:
        data.qpos[0] = place
        mujoco.mj_forward(model, data)
        counter.count(data)
        data.time += 0.02 + pause
    return counter.collisions


def test_staying_in_touch_is_one_collision() -> None:
    assert collisions([0.5, 0.9, 1.01, 1.01, 1.02]) == 1


def test_a_contact_that_chatters_is_one_collision() -> None:
    assert collisions([1.01, 0.98, 1.01, 0.98, 1.01]) == 1


def test_coming_back_is_another_collision() -> None:
    assert collisions([1.01, 0.5, 1.01], pause=CHATTER) == 2


@pytest.mark.parametrize(("label", "counted"), [(Label.CLUTTER, 1), (Label.VICTIM, 1), (Label.TERRAIN, 0)])
def test_the_ground_is_no_obstacle(label: Label, counted: int) -> None:
    assert collisions([1.01], label) == counted
