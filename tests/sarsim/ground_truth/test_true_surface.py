import mujoco
import numpy as np
import pytest

from pipeline.errors import InputError
from sarsim.ground_truth.true_surface import Survey, clearance_of
from sarsim.robots.skid_steered import robot_model

HEAD = """
<mujoco>
  <size nuser_geom="1"/>
  <asset>
    <mesh name="ramp" vertex="0 -0.6 0  0 0.6 0  0.59 -0.6 0  0.59 0.6 0  0.59 -0.6 0.17  0.59 0.6 0.17"/>
  </asset>
  <worldbody>
    <body name="robot" pos="0 0 0.3"><geom type="box" size="0.2 0.2 0.1" user="0"/></body>
    <geom name="floor" type="plane" size="2 2 0.1" user="2"/>
"""
NOWHERE = np.zeros(3)


def survey(geoms: str, start=NOWHERE, robot="pioneer3at"):
    model = mujoco.MjModel.from_xml_string(HEAD + geoms + "</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return Survey(model, data, model.body("robot").id, robot_model(robot)).surface_from(np.array(start))


def at(layer, surface, x, y):
    return surface.grid.at(layer, [x, y])


def test_an_empty_floor_is_drivable_but_for_its_rim():
    surface = survey("")
    assert surface.drivable.sum() * 0.05**2 == pytest.approx(3.4**2, rel=0.01)
    assert at(surface.height, surface, 0, 0) == pytest.approx(0, abs=1e-9)


def test_thin_walls_keep_the_robot_30_cm_away():
    surface = survey('<geom type="box" pos="1 0 0.6" size="0.005 2 0.6" user="1"/>')
    for x, expected in ((0.675, True), (0.725, False), (1.275, False), (1.325, False)):
        assert bool(at(surface.drivable, surface, x, 0.0)) is expected, x
    assert at(surface.walls, surface, 1.0, 0.5)
    assert not at(surface.walls, surface, 0.9, 0.5)


def test_what_no_way_leads_to_is_not_drivable():
    surface = survey('<geom type="box" pos="0.8 0 0.6" size="0.02 2 0.6" user="1"/>')
    assert not at(surface.drivable, surface, 1.5, 0.0)
    other = survey('<geom type="box" pos="0.8 0 0.6" size="0.02 2 0.6" user="1"/>', start=(1.5, 0, 0))
    assert at(other.drivable, other, 1.5, 0.0)
    assert not at(other.drivable, other, 0.0, 0.0)


def test_a_deck_without_a_ramp_cannot_be_climbed_and_with_one_it_can():
    deck = '<geom type="box" pos="1.3 0 0.085" size="0.71 0.6 0.085" user="4"/>'
    alone = survey(deck)
    assert not at(alone.drivable, alone, 1.3, 0.0)
    ramp = '<geom type="mesh" mesh="ramp" pos="0 0 0" user="3"/>'
    joined = survey(deck + ramp, start=(-1, 0, 0))
    assert at(joined.drivable, joined, 1.3, 0.0)
    assert at(joined.height, joined, 1.3, 0.0) == pytest.approx(0.17, abs=1e-6)
    assert not at(joined.drivable, joined, 1.3, 0.45)  # too near the edge
    assert not at(joined.drivable, joined, 1.3, 0.75)  # too near the deck's side


def test_low_steps_are_drivable_and_high_ones_are_not():
    for height, expected in ((0.07, True), (0.09, False)):
        step = f'<geom type="box" pos="1.5 0 {height / 2}" size="0.5 2 {height / 2}" user="4"/>'
        surface = survey(step)
        assert bool(at(surface.drivable, surface, 1.5, 0.0)) is expected


def test_headroom_counts_and_a_high_ceiling_does_not_matter():
    for height, expected in ((0.6, False), (0.7, True), (2.7, True)):
        board = f'<geom type="box" pos="1.5 0 {height + 0.05}" size="0.5 2 0.05" user="5"/>'
        surface = survey(board)
        assert bool(at(surface.drivable, surface, 1.5, 0.0)) is expected, height


def test_every_robot_is_held_to_its_own_body():
    assert [clearance_of(robot_model(robot)) for robot in ("pioneer3at", "jackal")] == [0.30, 0.27]
    gap = "".join(f'<geom type="box" pos="1 {side} 0.6" size="0.1 0.7 0.6" user="1"/>' for side in (-1.0, 1.0))
    board = '<geom type="box" pos="1 0 0.67" size="0.1 2 0.05" user="5"/>'
    for robot, expected in (("pioneer3at", False), ("jackal", True)):
        for narrow in (gap, board):
            surface = survey(narrow, robot=robot)
            assert bool(at(surface.drivable, surface, 1.5, 0.0)) is expected


def test_clutter_under_the_height_of_a_step_is_in_nobodys_way():
    for height, expected in ((0.05, True), (0.2, False)):
        block = f'<geom type="box" pos="1 0 {height / 2}" size="0.1 0.1 {height / 2}" user="7"/>'
        surface = survey(block)
        assert bool(at(surface.drivable, surface, 1.25, 0.0)) is expected


def test_ground_next_to_people_is_not_drivable_nor_what_they_close_off():
    hand = '<geom type="box" pos="1 0 0.01" size="0.05 0.05 0.01" user="6"/>'
    surface = survey(hand)
    for x, expected in ((0.475, True), (0.525, False), (1.475, False), (1.525, True)):
        assert bool(at(surface.drivable, surface, x, 0.025)) is expected, x
    wall = '<geom type="box" pos="1 {y} 0.6" size="0.02 0.6 0.6" user="1"/>'
    door = hand + "".join(wall.format(y=y) for y in (-1.4, 1.4))  # 1.6 m wide
    assert at(survey(door.replace('user="6"', 'user="2"')).drivable, survey(door), 1.5, 0.0)
    assert not at(survey(door).drivable, survey(door), 1.5, 0.0)
    start = (0.8, 0.0, 0.0)  # beside the hand: where the robot stands it may stand
    assert at(survey(hand, start).drivable, survey(hand, start), 0.8, 0.0)


def test_a_steep_slope_is_not_drivable():
    board = '<geom type="box" pos="1.2 0 {z}" size="0.7 0.9 0.01" euler="0 -{deg} 0" user="3"/>'
    for degrees, expected in ((15, True), (25, False)):
        z = 0.7 * np.sin(np.deg2rad(degrees)) - 0.01
        surface = survey(board.format(z=z, deg=degrees))
        assert bool(at(surface.drivable, surface, 1.2, 0.0)) is expected


@pytest.mark.parametrize("start", [(5.0, 0, 0), (1.0, 0, 0), (0.85, 0, 0)])
def test_a_start_off_the_floor_or_in_or_at_a_wall_is_refused(start):
    with pytest.raises(InputError, match=rf"at \({start[0]:g}, 0\) m; .* start with --start"):
        survey('<geom type="box" pos="1 0 0.6" size="0.1 2 0.6" user="1"/>', start=start)
