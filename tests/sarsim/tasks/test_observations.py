from types import SimpleNamespace

import numpy as np

from pipeline.grid_map import Grid
from pipeline.labels import Label
from pipeline.semantic_map.semantic_map import SemanticMap
from pipeline.transforms import from_yaw
from sarsim.tasks.observations import local_maps, picture


def test_local_maps_have_the_robot_in_the_middle_and_rows_along_y() -> None:
    grid = Grid(np.array([0, 0]), 0.05, (40, 40))  # 2 × 2 m, the robot at (1, 1)
    measured = np.full(grid.shape, np.nan, np.float32)
    measured[32:36, 20:24] = (0.1, 0.2, 0.3, 0.4)  # x from 1.6 m, y from 1 m: column 35, row 32
    elevation = measured.copy()
    elevation[0, 0] = 0.1  # known, but not seen
    semantic = SemanticMap()
    at = np.array([(1.71, 1.1, 0), (1.69, 1.1, 0.1), (1.65, 1.1, 0.2), (1.7, 1.1, 2), (9, 9, 0)], np.float32)
    classes = [Label.WALL, Label.WALL, Label.TERRAIN, Label.CEILING, Label.WALL]
    semantic.update(at, np.eye(len(Label), dtype=np.float32)[classes])
    mapper = SimpleNamespace(
        elevation_map=SimpleNamespace(grid=grid, measured=measured, elevation=elevation), semantic_map=semantic
    )
    maps = local_maps(mapper, from_yaw(1.0, 1.0, 0.25, 1.0))
    assert np.argwhere(maps["seen"]).tolist() == [[32, 35]]
    assert maps["label"][32, 35] == Label.WALL and np.count_nonzero(maps["label"]) == 1
    assert np.isclose(maps["elevation"][32, 35], 0.15) and np.isclose(maps["elevation"][27, 27], -0.15)
    assert np.count_nonzero(maps["elevation"]) == 2
    image = picture(np.zeros((64, 64, 3), np.uint8), maps)
    assert image.shape == (64, 128, 3) and image[63 - 32, 64 + 35].any() and not image[:, :64].any()
