"""The ground that the oracle's camera sees is the ground that the robot is credited with."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.errors import required
from pipeline.grid_map import Grid
from sarsim.arenas.load import load_arena
from sarsim.ground_truth.meshes import true_scene
from sarsim.ground_truth.true_surface import CELL, GroundTruthSurface
from sarsim.scoring.coverage import SEEN_HEIGHT
from sarsim.scoring.coverage_kernels import see
from sarsim.scoring.oracle import true_traversability
from sarsim.scoring.sight import Sight
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from tests.sarsim.rooms import TERRAIN, box, room

DECK = 0.3  # m above the floor and 0.3 m below the camera, so its angle of incidence reaches 82° at x = 2.3 m


@pytest.mark.parametrize(("sensor", "farthest"), [("xtion", 2.3), ("ideal", 3.65)])
def test_the_oracle_and_the_robot_see_the_same_part_of_a_deck(tmp_path, sensor, farthest):
    arena = tmp_path / "deck.xml"
    arena.write_text(room((-1.0, 5.0), (-1.0, 1.0), box((1.5, 5.0), (-1.0, 1.0), (0.0, DECK), TERRAIN)))
    robot = SimulatedRobot(load_arena(str(arena)), SimulationConfig(sensor=sensor), seed=0)
    frame, points = robot.sense(), required(robot.true_frame).points()
    scene = true_scene(robot.physics.model.ptr, robot.physics.data.ptr, robot.base_body)
    robot.close()

    grid = Grid(np.array([-30, -30]), CELL, (140, 60))
    x, y = np.moveaxis(grid.centre_of(np.moveaxis(np.indices(grid.shape), 0, -1)), -1, 0)
    on_deck = (x > 1.6) & (x < 4.9) & (abs(y) < 0.9)  # without the cells in which there are returns of walls
    surface = GroundTruthSurface(grid, np.where(on_deck, DECK, 0.0), on_deck, np.zeros(grid.shape, np.bool_))
    sight = Sight(
        surface, true_traversability(surface, robot.model), scene, replace(frame, sensor=robot.noise_free_sensor)
    )
    by_oracle, by_robot = np.zeros((2, *grid.shape), np.bool_)
    by_oracle[tuple(sight.cells[sight.views(np.zeros((1, 3))).indices].T)] = True
    see(points, grid.origin, grid.cell, surface.height, SEEN_HEIGHT, by_robot)
    for seen in (by_oracle, by_robot & on_deck):
        assert x[seen].max() == pytest.approx(farthest, abs=0.1)
    assert (by_oracle == by_robot)[on_deck].mean() > 0.95
