"""Which images are searched: those that show surface that was not searched from as near."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.arrays import Pose
from pipeline.finds.config import SearchConfig
from pipeline.finds.searched_surface import SearchedSurface
from pipeline.frame import Frame
from tests.pipeline.victims.rooms import camera_at, step

CONFIG = SearchConfig(share=0.2, nearer=0.75, near=1.0, voxel=0.3, stride=1)


def seen_from(x: float, y: float = 0.0) -> tuple[Frame, Pose]:
    """What a camera sees there, and its pose."""
    return step(camera_at(x, y)), camera_at(x, y)


def searched_from(x: float) -> SearchedSurface:
    surface = SearchedSurface(CONFIG)
    surface.add(surface.sight(*seen_from(x)))
    return surface


def is_new(surface: SearchedSurface, x: float, y: float = 0.0) -> bool:
    return surface.is_new(surface.sight(*seen_from(x, y)))


def test_what_was_never_searched_is_new_and_from_the_same_place_nothing_is() -> None:
    assert is_new(SearchedSurface(CONFIG), 0.0)
    assert not is_new(searched_from(0.0), 0.0)


def test_it_is_new_from_much_nearer_but_not_from_a_little_nearer_or_farther() -> None:
    surface = searched_from(0.0)
    assert not is_new(surface, 0.1)
    assert not is_new(surface, -0.5)
    assert is_new(surface, 1.5)


def test_what_was_searched_from_near_enough_is_not_new_from_nearer() -> None:
    surface = SearchedSurface(replace(CONFIG, near=10.0))
    surface.add(surface.sight(*seen_from(0.0)))
    assert not is_new(surface, 1.5)


def test_what_is_beside_it_is_new() -> None:
    assert is_new(searched_from(0.0), 0.0, 3.0)


@pytest.mark.parametrize("share", [0.0, 1.1])
def test_the_share_of_the_image_decides(share: float) -> None:
    surface = SearchedSurface(replace(CONFIG, share=share))
    sight = surface.sight(*seen_from(0.0))
    assert surface.is_new(sight) == (share == 0)
    assert sum(sight.returns.values()) <= sight.pixels
    assert min(sight.nearest.values()) >= CONFIG.near


def test_an_image_without_depth_shows_nothing_new() -> None:
    frame, T = seen_from(0.0)
    surface = SearchedSurface(CONFIG)
    assert not surface.is_new(surface.sight(replace(frame, depth=np.zeros_like(frame.depth)), T))
