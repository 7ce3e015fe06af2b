"""What stands out of a wall in a frame made by hand, and what is as red as a bottle."""

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.frame import Frame, Intrinsics
from pipeline.plugins.finds.config import FindsConfig
from pipeline.plugins.finds.protrusions import Protrusions, convex_hull, relief, square_around

LENS = Intrinsics(640, 480, 570.0, 570.0, 320.0, 240.0)
GREY = np.full((480, 640, 3), 90, np.uint8)
WALL, FLOOR = 2.0, 0.6  # m to the wall ahead, and down to the floor


def room(turn: float = 0.0) -> NDArray[np.float32]:
    """(480, 640) m, a floor and a wall whose normal is turned by ``turn`` rad about the vertical."""
    rays = LENS.rays.astype(np.float64)
    wall = WALL * np.cos(turn) / (rays[..., 2] * np.cos(turn) + rays[..., 0] * np.sin(turn))
    with np.errstate(divide="ignore"):
        floor = np.where(rays[..., 1] > 0, FLOOR / rays[..., 1], np.inf)
    return np.minimum(wall, floor).astype(np.float32)


def bottle(radius: float, height: float, away: float) -> NDArray[np.bool_ | np.float32]:
    """(480, 640) m, the front of an upright cylinder about the camera's height, infinite beside it."""
    x, y = LENS.rays[..., 0].astype(np.float64), LENS.rays[..., 1]
    square = away**2 - (1 + x**2) * (away**2 - radius**2)
    depth = (away - np.sqrt(np.maximum(square, 0))) / (1 + x**2)
    return np.where((square > 0) & (np.abs(y * depth) < height / 2), depth, np.inf).astype(np.float32)


def frame(depth: NDArray[np.float32], rgb: NDArray[np.uint8] = GREY) -> Frame:
    return Frame(0.0, rgb, depth, LENS, np.eye(4), np.eye(4))


def protrusions(seen: Frame) -> Protrusions:
    return Protrusions.of(seen, FindsConfig())


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_bottle_before_a_wall_stands_out_and_the_room_does_not(turn: float) -> None:
    assert protrusions(frame(room(turn))).regions == []
    alone = bottle(0.08, 0.45, WALL - 0.15)
    seen = protrusions(frame(np.minimum(room(turn), alone)))
    (region,) = seen.regions
    own = np.isfinite(alone)
    assert own[tuple(region.T)].all()
    assert 4 * len(region) > 0.9 * np.count_nonzero(own)
    assert seen.picture[240, 320, 3] == 255 and (seen.picture[:100, :, 3] == 0).all()


def test_what_is_larger_than_a_bottle_is_none() -> None:
    assert protrusions(frame(np.minimum(room(), bottle(0.08, 0.8, WALL - 0.15)))).regions == []
    assert protrusions(frame(np.minimum(room(), bottle(0.3, 0.45, WALL - 0.4)))).regions == []


def test_what_is_red_may_be_a_bottle_on_any_ground() -> None:
    red = GREY.copy()
    red[200:300, 300:340] = (150, 10, 8)
    (region,) = protrusions(frame(room(), red)).regions
    assert [*region.min(axis=0), *region.max(axis=0)] == pytest.approx([200, 300, 299, 339], abs=2)
    np.testing.assert_allclose(convex_hull(region).mean(axis=0), (320, 250), atol=2)
    square = square_around(region)
    np.testing.assert_allclose(square.mean(axis=0), (320, 250), atol=2)
    np.testing.assert_allclose(np.ptp(square, axis=0), 2 * 100, atol=4)


def test_relief_is_the_way_to_what_is_above_and_below() -> None:
    depth = room()
    depth[235:245, 280:360] = 1.94
    height = relief(depth, LENS, frame(depth).sensor, 0.675, 1.5)
    np.testing.assert_allclose(height[237:243, 290:350], 0.06, atol=1e-4)
    np.testing.assert_allclose(height[:200], 0, atol=1e-4)


def test_a_frame_without_returns_shows_nothing() -> None:
    assert protrusions(frame(np.full((480, 640), np.inf, np.float32))).regions == []
