import numpy as np
import pytest

from pipeline.grid_map import Grid
from sarsim.ground_truth.true_surface import GroundTruthSurface
from sarsim.plugins.league.portals import portals

CLEARANCE = 0.3


def surface_of(drivable):
    """Ground whose walls leave the robot's middle some cells."""
    grid = Grid(np.zeros(2, np.int64), 0.05, drivable.shape)
    walls = grid.distance_to(drivable) > CLEARANCE
    return GroundTruthSurface(grid, np.where(walls, np.nan, 0.0), drivable, walls)


def test_a_door_between_two_rooms_is_a_portal():
    """Rooms whose drivable parts are 2 m wide, and a door of 0.9 m: 0.3 m are left to the robot's middle."""
    drivable = np.zeros((104, 50), np.bool_)
    drivable[5:45, 5:45] = drivable[59:99, 5:45] = drivable[45:59, 22:28] = True
    (door,) = portals(surface_of(drivable), CLEARANCE)
    np.testing.assert_allclose(door, [2.6, 1.25], atol=0.1)


def test_a_wide_passage_is_none():
    drivable = np.zeros((104, 50), np.bool_)
    drivable[5:45, 5:45] = drivable[59:99, 5:45] = drivable[45:59, 8:42] = True
    assert len(portals(surface_of(drivable), CLEARANCE)) == 0


def test_what_lies_in_the_way_makes_no_door():
    surface = surface_of(np.pad(np.ones((60, 40), np.bool_), 8))
    surface.height[30:40, 8:30] = np.nan
    surface.drivable[24:46, 8:36] = False
    assert len(portals(surface, CLEARANCE)) == 0


@pytest.mark.parametrize(("arms", "count"), [("ns", 0), ("nse", 1), ("nsew", 1), ("ne", 0)])
def test_corridors_of_the_leagues_meet_in_a_junction(arms, count):
    drivable = np.zeros((80, 80), np.bool_)
    places = {"n": np.s_[34:46, 34:75], "s": np.s_[34:46, 5:46], "e": np.s_[34:75, 34:46], "w": np.s_[5:46, 34:46]}
    for arm in arms:
        drivable[places[arm]] = True
    found = portals(surface_of(drivable), CLEARANCE)
    assert len(found) == count
    np.testing.assert_allclose(found, np.full((count, 2), 2.0), atol=0.15)
