"""Slopes, drops and ceilings of ground with a known shape."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.elevation_map.traversability import assess_map
from pipeline.planning.pose_paths import PosePaths
from pipeline.rescue_report.config import HazardConfig
from pipeline.rescue_report.hazards import Hazards, find_hazards
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import RISE, RUN, flat, ground_points, ridge, surface_of, wall_points

AREA = (-1.5, 1.5), (-1.0, 1.0)
NO_POINTS = np.zeros((0, 3), np.float32)


def hazards_of(*clouds: NDArray[np.float32], start=(-1.0, 0.0), above: NDArray[np.float32] = NO_POINTS) -> Hazards:
    traversability = assess_map(surface_of(*clouds))
    reachable = PosePaths(traversability, start).reachable
    return find_hazards(traversability, reachable, np.vstack([*clouds, above]), PIONEER, HazardConfig())


def terrace(x: NDArray, y: NDArray) -> NDArray:
    """Level ground that is 0.4 m lower where y > 0.5."""
    return np.where(y > 0.5, -0.4, 0.0) + 0 * x


def test_level_ground_between_walls_has_no_dangers() -> None:
    hazards = hazards_of(ground_points(flat, *AREA), wall_points((-1.5, 0.9), (1.5, 0.9)))
    assert hazards.slopes == hazards.drops == hazards.ceilings == []


def test_a_block_is_no_drop() -> None:
    block = ground_points(lambda x, y: np.full_like(x, 0.25), (0.2, 0.6), (-0.2, 0.2))
    assert hazards_of(ground_points(flat, *AREA), block).drops == []


def test_both_sides_of_a_ridge_are_slopes() -> None:
    hazards = hazards_of(ground_points(ridge, *AREA))
    assert [place.value for place in hazards.slopes] == pytest.approx([np.arctan(RISE / RUN)] * 2, abs=0.01)
    assert sorted(place.position[0] for place in hazards.slopes) == pytest.approx([-RUN / 2, RUN / 2], abs=0.08)
    assert hazards.drops == []


def test_an_edge_is_a_drop_from_above_alone() -> None:
    ground = ground_points(terrace, *AREA)
    (drop,) = hazards_of(ground).drops
    assert drop.value == pytest.approx(0.4, abs=0.001)
    assert drop.position == pytest.approx([0, 0.475], abs=0.051)
    assert hazards_of(ground, start=(0.0, 0.9)).drops == []


def test_a_drop_to_ground_that_is_seen_from_afar() -> None:
    above, below = (ground_points(flat, (-1.5, 1.5), (-1.0, 0.5)), ground_points(terrace, (-1.5, 1.5), (0.9, 1.5)))
    (drop,) = hazards_of(above, below).drops
    assert drop.value == pytest.approx(0.4, abs=0.001)


@pytest.mark.parametrize(("width", "drops"), [(0.1, 0), (0.3, 1)])
def test_a_slit_beside_the_ground_is_no_drop(width: float, drops: int) -> None:
    ground = ground_points(terrace, (-1.5, 1.5), (-1.0, 0.5 + width))
    wall = wall_points((-1.5, 0.53 + width), (1.5, 0.53 + width))
    assert len(hazards_of(ground, wall).drops) == drops


def test_there_is_no_drop_to_the_ground_behind_a_wall() -> None:
    above, below = (ground_points(flat, (-1.5, 1.5), (-1.0, 0.5)), ground_points(terrace, (-1.5, 1.5), (0.6, 1.5)))
    # A kerb in front of the wall, like the lower part of a wall that is seen badly.
    kerb = ground_points(lambda x, y: np.full_like(x, 0.05), (-1.5, 1.5), (0.45, 0.5))
    wall = wall_points((-1.5, 0.53), (1.5, 0.53))
    assert hazards_of(above, kerb, below).drops != []
    assert hazards_of(above, kerb, wall, below).drops == []


def test_what_hangs_low_is_a_ceiling() -> None:
    beam = ground_points(lambda x, y: np.full_like(x, 1.3), (0.0, 0.2), (-0.3, 0.3))
    hazards = hazards_of(ground_points(flat, *AREA), above=beam)
    (ceiling,) = hazards.ceilings
    assert ceiling.value == pytest.approx(1.3, abs=0.001)
    assert ceiling.position == pytest.approx([0.1, 0.0], abs=0.051)
    assert ceiling.area == pytest.approx(0.2 * 0.6, abs=0.001)


def test_a_high_ceiling_is_none() -> None:
    roof = ground_points(lambda x, y: np.full_like(x, 2.4), *AREA)
    assert hazards_of(ground_points(flat, *AREA), above=roof).ceilings == []
