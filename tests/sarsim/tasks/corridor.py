"""A corridor as a 2D map, and rules of exploring it."""

import numpy as np

from sarsim.tasks.grid_scenes import GridScene
from sarsim.tasks.grid_world import GridRules

RULES = GridRules(20, 360.0, 0.5, 3, 5, 1, 20, 200)


def hall() -> GridScene:
    """A corridor of 11 × 100 cells whose robot stands 20 cells from its left end."""
    free = np.zeros((21, 110), np.bool_)
    free[5:16, 5:105] = True
    return GridScene(free, (10, 25), 1.0)
