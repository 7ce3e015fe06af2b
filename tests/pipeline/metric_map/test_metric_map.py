"""Small cases by hand, and bad input."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.frame import Intrinsics
from pipeline.metric_map.metric_map import FREE, OCCUPIED, UNKNOWN, MetricMap, MetricMapConfig

CAMERA = Intrinsics(width=64, height=48, fx=57.7, fy=57.9, cx=32.0, cy=24.0)

T_MAP_CAMERA = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0.5], [0, 0, 0, 1]])
"""At (0, 0, 0.5) m, looking along x of ``map``."""


def wall(depth: float = 2.0) -> np.ndarray:
    return np.full((48, 64), depth, np.float32)


def test_wall_ahead_is_occupied_space_before_it_free_and_behind_it_unknown() -> None:
    grid = MetricMap()
    grid.integrate(wall(), CAMERA, T_MAP_CAMERA)
    states = grid.state_at(
        [(1, 0, 0.5), (1.9, 0, 0.5), (2, 0, 0.5), (2.11, 0, 0.5), (-0.2, 0, 0.5), (1, 1, 0.5)]
    )
    assert states.tolist() == [FREE, FREE, OCCUPIED, UNKNOWN, UNKNOWN, UNKNOWN]


def test_return_beyond_the_range_frees_up_to_the_range_and_ends_nowhere() -> None:
    grid = MetricMap(MetricMapConfig(max_range=3.0))
    grid.integrate(wall(5.0), CAMERA, T_MAP_CAMERA)
    assert grid.state_at([(2.9, 0, 0.5), (3.2, 0, 0.5), (5, 0, 0.5)]).tolist() == [FREE, UNKNOWN, UNKNOWN]
    assert len(grid.occupied_centres()) == 0


@pytest.mark.parametrize("nothing", [0.0, -1.0, np.nan, np.inf, -np.inf])
def test_no_return_changes_nothing(nothing: float) -> None:
    grid = MetricMap()
    grid.integrate(wall(nothing), CAMERA, T_MAP_CAMERA)
    assert grid.array()[0].size == 0


def test_points_mark_their_voxels_and_free_the_way() -> None:
    grid = MetricMap()
    grid.integrate_points([(1.0, 0.0, 0.0)], (0.0, 0.0, 0.0))
    assert len(grid.occupied_centres()) == 1
    np.testing.assert_allclose(
        grid.free_centres(), [(0.025 + 0.1 * i, 0.025, 0.01) for i in range(10)], atol=1e-6
    )


def test_map_survives_its_file(tmp_path) -> None:
    grid = MetricMap(MetricMapConfig(voxel_size=0.2))
    grid.integrate(wall(), CAMERA, T_MAP_CAMERA)
    grid.save(tmp_path / "map.npz")
    again = MetricMap.load(tmp_path / "map.npz")
    assert again.config == grid.config
    np.testing.assert_array_equal(again.array()[0], grid.array()[0])
    np.testing.assert_array_equal(again.array()[1], grid.array()[1])


def test_intrinsics_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputError, match="does not fit"):
        MetricMap().integrate(wall()[:-1], CAMERA, T_MAP_CAMERA)


def test_pose_that_is_not_rigid_is_refused() -> None:
    with pytest.raises(InputError, match="rigid"):
        MetricMap().integrate(wall(), CAMERA, np.diag([1.0, 1, -1, 1]))


def test_foreign_file_is_refused(tmp_path) -> None:
    (tmp_path / "map.npz").write_bytes(b"PK not a map")
    with pytest.raises(InputError, match=r"map\.npz"):
        MetricMap.load(tmp_path / "map.npz")
