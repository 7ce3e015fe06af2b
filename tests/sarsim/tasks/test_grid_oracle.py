import numpy as np
import pytest

from pipeline.errors import InputError
from sarsim.tasks.grid_explorers import EXPLORERS, explore
from sarsim.tasks.grid_oracle import GridOracle
from sarsim.tasks.grid_world import CAMERA, GridWorld
from tests.sarsim.tasks.corridor import RULES, hall


def test_a_tour_is_feasible_not_below_its_bound_and_no_longer_than_an_explorers_way() -> None:
    oracle, world, other = GridOracle(hall(), RULES), GridWorld(hall(), RULES), GridWorld(hall(), RULES)
    assert oracle.follow(world) == "nothing_left" and world.is_explored
    explore(other, EXPLORERS["nearest_frontier"], np.random.default_rng(0))
    assert 0 < oracle.least_way() <= world.way <= other.way
    assert world.way == pytest.approx(oracle.quickest.metres)


def test_a_camera_has_no_oracle_on_2d_maps() -> None:
    with pytest.raises(InputError, match="360°, not 58°"):
        GridOracle(hall(), CAMERA)
