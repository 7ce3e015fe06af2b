"""The points of a plane vote on their classes."""

import numpy as np
import pytest

from pipeline.frame import Frame
from pipeline.labels import Label
from pipeline.segments.surfels_kernels import NONE
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.networks.blocks import CLASS_OF_LABEL
from pipeline.semantic_map.planar_vote import possible_classes, vote_on_planes
from pipeline.semantic_map.planar_vote_kernels import (
    log_probabilities_of_possible,
    mean_logs,
    normalised_products,
    planes_of_pixels,
)
from tests.pipeline.polygon_scene import floor, look, pose, wall, wedge

EYE = pose(0.3, 0.4, 0.6, 0.6, 0.25)
ROOM = [floor(0, 4, 0, 4), wall((3, 4), (3, 0)), wall((0, 3.5), (4, 3.5)), *wedge(1.6, 1.6, 0.6, 1.2, 0.17)]
FRAME = look(ROOM, EYE, sigma=0.01)
TRUTH = FRAME.label[FRAME.returns]


def unsure(labels: np.ndarray) -> np.ndarray:
    """(N, 6) probabilities of 0.75 for the labels."""
    return np.where(np.eye(len(CLASSES))[CLASS_OF_LABEL[labels]] > 0, 0.75, 0.05).astype(np.float32)


def vote(frame: Frame, T: np.ndarray, given: np.ndarray) -> np.ndarray:
    """(N,) labels."""
    return np.array(CLASSES)[vote_on_planes(frame, T, unsure(given), 2.0).argmax(axis=1)]


def test_speckles_are_outvoted() -> None:
    rng = np.random.default_rng(0)
    given = np.where(rng.random(len(TRUTH)) < 0.3, rng.choice(CLASSES, len(TRUTH)), TRUTH)
    assert (given == TRUTH).mean() < 0.8
    assert (vote(FRAME, EYE, given) == TRUTH).mean() > 0.98


def test_edges_are_where_planes_meet() -> None:
    z = FRAME.points(EYE)[:, 2]
    given = np.where((TRUTH == Label.WALL) & (z < 0.05), Label.TERRAIN, TRUTH)
    at_edge = given != TRUTH
    assert at_edge.sum() > 1000
    assert (vote(FRAME, EYE, given) == TRUTH)[at_edge].mean() > 0.9


def test_a_level_deck_and_the_floor_do_not_vote_together() -> None:
    scene = [floor(0, 4, -2, 2), floor(1.5, 2.5, -0.5, 0.5, z=0.1, label=Label.STRAIGHT_RAMP)]
    eye = pose(0, 0, 0.6, 0, 0.3)
    frame = look(scene, eye, sigma=0.005)
    truth = frame.label[frame.returns]
    assert (vote(frame, eye, truth) == truth).mean() > 0.995


def test_what_a_plane_may_be_follows_from_how_it_leans() -> None:
    level, low, ramp, wall = possible_classes(np.cos(np.radians([1, 10, 130, 89])))
    names = [{CLASSES[i] for i in np.flatnonzero(row)} for row in (level, low, ramp, wall)]
    flat = {Label.TERRAIN, Label.STRAIGHT_RAMP, Label.CEILING, Label.CLUTTER}
    assert names == [
        flat,
        flat | {Label.INCLINED_RAMP},
        {Label.INCLINED_RAMP, Label.CLUTTER},
        {Label.WALL, Label.INCLINED_RAMP, Label.STRAIGHT_RAMP, Label.CLUTTER},
    ]


def test_a_slope_is_a_ramp_if_the_network_takes_it_for_a_wall() -> None:
    given = np.where(TRUTH == Label.INCLINED_RAMP, Label.WALL, TRUTH)
    upwards = FRAME.instance[FRAME.returns] == 3  # the others are the wedge's sides
    assert upwards.sum() > 1000
    assert (vote(FRAME, EYE, given) == TRUTH)[upwards].mean() > 0.95


def test_what_is_on_no_plane_keeps_its_probabilities() -> None:
    small = [floor(0, 4, 0, 4), wall((1.5, 1.50), (1.5, 1.53), 0.3, 0.34)]
    frame = look(small, EYE)
    given = np.random.default_rng(0).dirichlet(np.ones(6), np.count_nonzero(frame.returns)).astype(np.float32)
    on_wall = frame.label[frame.returns] == Label.WALL
    assert 0 < on_wall.sum() < 10 * 2 * 8  # pixels of the fewest surfels of a plane
    voted = vote_on_planes(frame, EYE, given, 2.0)
    assert np.array_equal(voted[on_wall], given[on_wall])
    assert voted.sum(axis=1) == pytest.approx(np.ones(len(voted)), abs=1e-5)
    assert not np.array_equal(voted[~on_wall], given[~on_wall])


@pytest.mark.parametrize(("window", "expected"), [(0, 1), (1, 0)])
def test_a_pixel_that_could_be_on_two_planes_goes_with_its_neighbours(window: int, expected: int) -> None:
    depth = np.full((3, 3), 2, np.float32)
    depth[1, 1], depth[0, 0] = 2.015, 3
    rays = np.zeros((3, 3, 3), np.float32)
    rays[..., 2] = 1
    near, region = np.array([[1, NONE], [0, NONE]], np.int32), np.array([0, 1], np.int32)
    planes = np.array([(0, 0, 1, 2.0), (0, 0, -1, -2.02)])
    of_pixel = np.zeros((3, 3), np.int32)
    of_pixel[2, 2] = NONE
    plane = planes_of_pixels(depth, rays, of_pixel, near, region, planes, 0.05, 0, window)
    assert plane.tolist() == [[NONE, 0, 0], [0, expected, 0], [0, 0, NONE]]


def test_a_frame_without_returns() -> None:
    frame = look([floor(90, 99, 90, 99)], EYE)
    assert vote_on_planes(frame, EYE, np.empty((0, 6), np.float32), 2.0).shape == (0, 6)


def test_what_is_impossible_goes_to_what_is_possible_but_not_to_clutter() -> None:
    probabilities = np.array([(0.4, 0.3, 0.1, 0.2), (0.4, 0.3, 0.1, 0.2)], np.float32)
    plane, possible = np.array([0, NONE], np.int32), np.array([(False, True, True, True)])
    shared, alone = np.exp(log_probabilities_of_possible(probabilities, plane, possible, 3, 1e-3))
    assert shared == pytest.approx([0, 0.6, 0.2, 0.2], abs=1e-6)
    assert alone == pytest.approx(probabilities[1], abs=1e-6)


def test_the_product_by_hand() -> None:
    probabilities = np.array([(0.5, 0.5), (0.8, 0.2), (0.3, 0.7)], np.float32)
    plane = np.array([0, 0, NONE], np.int32)
    means = mean_logs(np.log(probabilities), plane, 2)
    assert means == pytest.approx(np.log([(np.sqrt(0.4), np.sqrt(0.1)), (1, 1)]), abs=1e-6)
    voted = normalised_products(probabilities, np.log(probabilities), means, plane)
    # The plane's geometric mean has odds of 2 : 1.
    assert voted == pytest.approx(np.array([(2 / 3, 1 / 3), (8 / 9, 1 / 9), (0.3, 0.7)]), abs=1e-6)
