from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pipeline.errors import InputError
from sarsim.tasks import grid_kernels as kernels
from sarsim.tasks.grid_scenes import GridScene, dungeon_files, read_dungeon, read_ros_scene
from sarsim.tasks.grid_world import GridRules, GridWorld, route

SMALL = GridRules(6, 360.0, 0.5, 2, 4, 2, 0, 20)


def corridor(length: int) -> GridScene:
    """A corridor three cells wide, with walls around it."""
    free = np.zeros((9, length + 2), np.bool_)
    free[3:6, 1:-1] = True
    return GridScene(free, (4, 2), 0.5)


def test_a_ray_sees_free_cells_up_to_its_range_and_enters_walls_by_less_than_so_many_cells() -> None:
    free = np.zeros((1, 12), np.bool_)
    free[0, :5] = True
    belief = np.zeros(free.shape, np.uint8)
    assert kernels.sense(free, belief, 0, 0, np.zeros(1), 20, 3) == 5
    assert belief[0].tolist() == [kernels.IS_FREE] * 5 + [kernels.IS_WALL] * 2 + [kernels.IS_UNKNOWN] * 5
    belief[:] = 0
    assert kernels.sense(free, belief, 0, 0, np.zeros(1), 3, 3) == 3


def test_a_line_is_clear_if_all_its_cells_are_known_free() -> None:
    belief = np.full((5, 5), kernels.IS_FREE, np.uint8)
    assert kernels.is_clear(belief, 0, 0, 4, 4)
    belief[2, 2] = kernels.IS_UNKNOWN
    assert not kernels.is_clear(belief, 0, 0, 4, 4)
    assert kernels.is_clear(belief, 0, 1, 4, 1)


def test_frontiers_are_free_cells_with_two_to_seven_unknown_neighbours() -> None:
    thinned = np.full((5, 6), kernels.IS_FREE, np.uint8)
    thinned[:, 4:] = kernels.IS_UNKNOWN
    thinned[2, 0] = kernels.IS_UNKNOWN  # one unknown neighbour is not enough
    assert np.argwhere(kernels.frontier_mask(thinned)).tolist() == [[1, 3], [2, 3], [3, 3]]


def test_the_robot_follows_a_corridor_to_its_end() -> None:
    world = GridWorld(corridor(20), SMALL)
    assert not world.is_explored
    for _ in range(5):
        ways, before = world.ways(world.here)
        reachable = np.flatnonzero(np.isfinite(ways))
        node = int(reachable[world.nodes[reachable][:, 1].argmax()])
        for stop in route(before, world.here, node):
            world.move(stop)
    assert world.is_explored and world.explored_fraction == 1.0
    assert world.way == 16.0 and world.nodes[world.here].tolist() == [4, 18]


def test_ways_are_the_shortest_along_edges() -> None:
    free = np.ones((21, 21), np.bool_)
    world = GridWorld(GridScene(free, (10, 10), 1.0), GridRules(40, 360.0, 0.5, 2, 5, 2, 0, 9))
    ways, _ = world.ways(world.here)
    offsets = abs(world.nodes - 10) / 5
    far, near = offsets.max(axis=1), offsets.min(axis=1)
    on_lattice = {(0, 0): 0.0, (1, 0): 1.0, (2, 0): 2.0, (1, 1): 2**0.5, (2, 1): 5**0.5, (2, 2): 8**0.5}
    assert np.allclose(ways, [5 * on_lattice[pair] for pair in zip(far, near, strict=True)])


def test_a_ros_map_starts_at_its_origin(tmp_path: Path) -> None:
    pixels = np.full((10, 10), 254, np.uint8)
    pixels[0] = 0
    Image.fromarray(pixels).save(tmp_path / "map.pgm")
    (tmp_path / "map.yaml").write_text("image: map.pgm\nresolution: 0.5\norigin: [-1.0, -2.0, 0.0]\n")
    scene = read_ros_scene(tmp_path / "map.yaml")
    assert scene.cell == 0.5 and scene.free.sum() == 90 and not scene.free[9].any()
    assert scene.start in [(row, col) for row in (3, 4) for col in (1, 2)]


def test_a_dungeon_map_needs_a_start(tmp_path: Path) -> None:
    Image.fromarray(np.full((9, 9, 3), 194, np.uint8)).save(tmp_path / "map.png")
    with pytest.raises(InputError, match="no start"):
        read_dungeon(tmp_path / "map.png")
    with pytest.raises(InputError, match=r"no \.png maps"):
        dungeon_files(tmp_path / "empty")


def test_a_dungeon_maps_robot_starts_in_the_middle_of_the_marked_square(tmp_path: Path) -> None:
    pixels = np.full((40, 40, 4), 127, np.uint8)
    pixels[4:36, 4:36] = 194
    pixels[8:24, 12:28] = (255, 216, 0, 255)
    Image.fromarray(pixels).save(tmp_path / "map.png")
    scene = read_dungeon(tmp_path / "map.png")
    assert scene.start == (8 + 127 // 16, 12 + 127 % 16) and scene.free.sum() == 32 * 32
