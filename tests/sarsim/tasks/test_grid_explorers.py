import numpy as np
import pytest

from sarsim.tasks.grid_explorers import EXPLORERS, Sights, explore
from sarsim.tasks.grid_world import GridWorld
from tests.sarsim.tasks.corridor import RULES, hall


@pytest.mark.parametrize("name", sorted(set(EXPLORERS) - {"random_walk"}))
def test_a_hall_is_explored_without_much_detour(name: str) -> None:
    world = GridWorld(hall(), RULES)
    assert explore(world, EXPLORERS[name], np.random.default_rng(0)) == "nothing_left"
    assert world.is_explored
    assert 60 <= world.way <= 110  # to where the right end is in view; the left one shows from nearby


def test_a_random_walk_is_cut_off_and_follows_its_seed() -> None:
    ways = []
    for seed in (0, 0, 1):
        world = GridWorld(hall(), RULES)
        assert explore(world, EXPLORERS["random_walk"], np.random.default_rng(seed)) in ("steps", "nothing_left")
        ways.append(world.way)
    assert ways[0] == ways[1] != ways[2]


def test_frontiers_are_seen_from_nodes_where_the_robot_has_not_looked() -> None:
    world = GridWorld(hall(), RULES)
    sights = Sights.of(world)
    assert sights.visible.any(axis=0).all() and world.here not in sights.nodes
    assert (sights.frontiers[:, 1] > 40).any()
