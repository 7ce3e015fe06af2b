import numpy as np

from scripts.benchmarks.sieve.__main__ import ORACLE, compare, table
from scripts.benchmarks.sieve.explorers import EXPLORERS
from scripts.benchmarks.sieve.world import GridRules, GridScene


def test_every_explorer_sees_a_hall_and_none_goes_less_far_than_the_oracle() -> None:
    free = np.zeros((21, 110), np.bool_)
    free[5:16, 5:105] = True
    scenes = [GridScene(free, (10, col)) for col in (25, 60)]
    rules = GridRules(reach=20, wall=3, spacing=5, thinning=1, most_unseen=20, most_moves=200)
    ways = compare(scenes, [ORACLE, *EXPLORERS], rules)
    assert all((ways[ORACLE] <= way).all() and np.isfinite(way).all() for way in ways.values())
    assert ways[ORACLE][0] >= 60  # to where the right end is in view; the left one shows from nearby
    assert table(ways).row_count == len(ways)
