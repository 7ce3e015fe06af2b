"""Which unseen ground is worth a look."""

import numpy as np

from pipeline.elevation_map.traversability import assess_map
from pipeline.exploration.frontiers import unseen_cells
from pipeline.exploration.viewpoint import Context
from pipeline.planning.pose_paths import PosePaths
from pipeline.transforms import from_yaw
from tests.pipeline.still_robot import StillRobot
from tests.pipeline.worlds import flat, ground_points, surface_of, wall_points


def test_ground_beside_walls_is_worth_a_look_where_ways_may_be_tight():
    ground = ground_points(flat, (-1, 1), (-1, 1))
    is_hole = (np.abs(ground[:, 0] - 0.5) < 0.1) & (ground[:, 1] > 0.8)
    known = surface_of(ground[~is_hole], wall_points((-1, 1), (1, 1)))
    world, T = assess_map(known), from_yaw(0, 0, 0, 0)
    normal, tight = (
        unseen_cells(Context(StillRobot().sense(), T, known.measured, PosePaths(w, (0, 0)), T[None]))
        for w in (world, world.without_margin)
    )
    beside = world.grid.cell_of(np.array([0.475, 0.925]))
    assert tight[tuple(beside)] and not normal[tuple(beside)]
    assert (tight >= normal).all()
    assert not (tight & world.hazard).any()
