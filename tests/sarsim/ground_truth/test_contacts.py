"""A block on a rail that is pushed against a wall, or lowered onto one."""

import mujoco
import numpy as np
import pytest

from pipeline.labels import Label
from sarsim.ground_truth.contacts import DEBOUNCE_TIME, CollisionCounter

WORLD = """
<mujoco>
  <option gravity="0 0 0"/>
  <size nuser_geom="1"/>
  <worldbody>
    <geom name="met" type="box" size="{size}" pos="{place}" user="{label:d}"/>
    <body name="robot">
      <joint type="slide" axis="{axis}"/>
      <geom type="box" size=".1 .1 .1" user="0"/>
    </body>
  </worldbody>
</mujoco>
"""


AHEAD = {"axis": "1 0 0", "place": "1.2 0 0", "size": ".1 1 1"}
BELOW = {"axis": "0 0 -1", "place": "0 0 -1.2", "size": "1 1 .1"}
ABOVE = {"axis": "0 0 1", "place": "0 0 1.2", "size": "1 1 .1"}


def counted(
    places: list[float], label: Label, pause: float = 0.0, is_living: bool = False, where: dict[str, str] = AHEAD
) -> CollisionCounter:
    """With the robot at each of these places along its rail, one after the other."""
    model = mujoco.MjModel.from_xml_string(WORLD.format(label=label, **where))
    data = mujoco.MjData(model)
    living = [np.array([model.geom("met").id])] if is_living else []
    counter = CollisionCounter(model, model.body("robot").id, living)
    for place in places:
        data.qpos[0] = place
        mujoco.mj_forward(model, data)
        counter.count(data)
        data.time += 0.02 + pause
    return counter


def collisions(places: list[float], label: Label = Label.WALL, pause: float = 0.0) -> int:
    return counted(places, label, pause).collisions


def test_staying_in_touch_is_one_collision() -> None:
    assert collisions([0.5, 0.9, 1.01, 1.01, 1.02]) == 1


def test_a_contact_that_chatters_is_one_collision() -> None:
    assert collisions([1.01, 0.98, 1.01, 0.98, 1.01]) == 1


def test_coming_back_is_another_collision() -> None:
    assert collisions([1.01, 0.5, 1.01], pause=DEBOUNCE_TIME) == 2


@pytest.mark.parametrize(("label", "number"), [(Label.CLUTTER, 1), (Label.VICTIM, 1), (Label.TERRAIN, 0)])
def test_the_ground_is_no_obstacle(label: Label, number: int) -> None:
    assert collisions([1.01], label) == number


@pytest.mark.parametrize(("where", "label", "number"), [
    (BELOW, Label.WALL, 0),
    (BELOW, Label.CLUTTER, 1),
    (ABOVE, Label.WALL, 1),
])  # fmt: skip
def test_standing_on_a_wall_is_no_collision(where: dict[str, str], label: Label, number: int) -> None:
    assert counted([1.01], label, where=where).collisions == number


@pytest.mark.parametrize(("label", "number"), [(Label.VICTIM, 2), (Label.CLUTTER, 0), (Label.WALL, 0)])
def test_contacts_with_people_are_counted_among_all(label: Label, number: int) -> None:
    counter = counted([1.01, 0.5, 1.01], label, DEBOUNCE_TIME)
    assert (counter.collisions, counter.with_people) == (2, number)


def test_contacts_with_the_living_are_counted_apart() -> None:
    assert counted([1.01, 0.5, 1.01], Label.VICTIM, DEBOUNCE_TIME, is_living=True).with_living == 2
    assert counted([1.01, 1.02], Label.VICTIM).with_living == 0
