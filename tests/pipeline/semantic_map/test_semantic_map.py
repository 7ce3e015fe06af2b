"""The voxel map against small cases by hand and a dictionary."""

from collections import defaultdict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.semantic_map.semantic_map import SemanticMap


def one_hot(*labels: int) -> np.ndarray:
    return np.eye(8, dtype=np.float32)[list(labels)]


def cloud(*points: tuple[float, float, float]) -> np.ndarray:
    return np.array(points, np.float32).reshape(-1, 3)


def test_points_of_one_voxel_become_their_mean_and_the_majority_wins() -> None:
    semantic_map = SemanticMap()
    semantic_map.update(
        cloud((0.001, 0.001, 0.001), (0.003, 0.005, 0.001), (0.005, 0.003, 0.001), (0.021, 0, 0)), one_hot(1, 2, 2, 3)
    )
    assert semantic_map.points() == pytest.approx(cloud((0.003, 0.003, 0.001), (0.021, 0, 0)))
    assert semantic_map.labels().tolist() == [2, 3]
    assert semantic_map.hits().tolist() == [3, 1]
    assert semantic_map.probabilities()[0, :3] == pytest.approx([0, 1 / 3, 2 / 3])


def test_frames_are_fused() -> None:
    semantic_map = SemanticMap()
    for label in (1, 2, 2):
        semantic_map.update(cloud((1.01, 0.01, 0.01)), one_hot(label))
    assert len(semantic_map) == 1
    assert semantic_map.labels().tolist() == [Label.TERRAIN]


class HighIsClutter:
    """Other maps that call everything above half a metre clutter."""

    def revised(self, points: np.ndarray, labels: np.ndarray, voxel: float) -> np.ndarray:
        return np.where(points[:, 2] > 0.5, Label.CLUTTER, labels).astype(np.uint8)


def test_labels_are_revised_when_the_map_is_told_and_so_are_those_of_later_points() -> None:
    semantic_map = SemanticMap()
    semantic_map.update(cloud((0, 0, 0.4), (0, 0, 0.6)), one_hot(4, 3))
    assert semantic_map.labels().tolist() == [4, 3]
    semantic_map.revise(HighIsClutter())
    assert semantic_map.labels().tolist() == [4, Label.CLUTTER]
    semantic_map.update(cloud((0, 0.2, 0.6), (2, 0, 0.1)), one_hot(1, 1))
    assert semantic_map.labels().tolist() == [4, Label.CLUTTER, Label.CLUTTER, 1]


def test_sides_of_zero_are_different_voxels() -> None:
    semantic_map = SemanticMap()
    semantic_map.update(cloud((0.001, 0, 0), (-0.001, 0, 0), (0, -0.001, 0), (0, 0, -0.001)), one_hot(1, 1, 1, 1))
    assert len(semantic_map) == 4


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e30, -1e6])
def test_points_that_are_nowhere_are_left_out(bad: float) -> None:
    semantic_map = SemanticMap()
    semantic_map.update(cloud((bad, 0, 0), (0, bad, 0), (0, 0, bad), (1, 1, 1)), one_hot(1, 1, 1, 2))
    assert semantic_map.labels().tolist() == [2]


def test_points_without_a_probability_are_left_out() -> None:
    semantic_map = SemanticMap()
    semantic_map.update(cloud((0, 0, 0), (1, 1, 1)), np.stack([np.full(8, np.nan), np.eye(8)[3]]).astype(np.float32))
    assert semantic_map.labels().tolist() == [3]


def test_empty_frame_changes_nothing() -> None:
    semantic_map = SemanticMap()
    semantic_map.update(cloud(), one_hot())
    assert semantic_map.points().shape == (0, 3)
    assert semantic_map.probabilities().shape == (0, 8)
    semantic_map.update(cloud((0, 0, 0)), one_hot(1))
    semantic_map.update(cloud(), one_hot())
    assert len(semantic_map) == 1


def test_memory_does_not_grow_with_frames_of_the_same_surface() -> None:
    rng = np.random.default_rng(0)
    semantic_map = SemanticMap()
    for _ in range(20):
        points = rng.uniform(0, 0.5, (20_000, 3)).astype(np.float32) * [1, 1, 0]
        semantic_map.update(points.astype(np.float32), np.full((20_000, 8), 1 / 8, np.float32))
    assert len(semantic_map) == 25 * 25
    assert semantic_map.hits().sum() == 400_000


@given(
    arrays(np.float32, st.tuples(st.integers(0, 60), st.just(3)), elements=st.floats(-0.125, 0.125, width=32)),
    st.integers(0, 2**32 - 1),
)
def test_agrees_with_a_dictionary(points: np.ndarray, seed: int) -> None:
    labels = np.random.default_rng(seed).integers(0, 8, len(points))
    semantic_map = SemanticMap()
    expected = defaultdict(list)
    for n, point in enumerate(points):
        expected[tuple(np.floor(point.astype(np.float64) * (1 / 0.02)))].append(n)
    for half in (slice(0, len(points) // 2), slice(len(points) // 2, None)):
        semantic_map.update(points[half], one_hot(*labels[half]))
    assert len(semantic_map) == len(expected)
    for row, members in enumerate(expected.values()):
        assert semantic_map.points()[row] == pytest.approx(points[members].mean(axis=0), abs=1e-6)
        counts = np.bincount(labels[members], minlength=8)
        assert semantic_map.probabilities()[row] == pytest.approx(counts / len(members))
        assert semantic_map.labels()[row] == counts.argmax()


def test_shapes_that_do_not_fit_are_refused() -> None:
    for points, probabilities in (
        (np.zeros((3, 2)), np.zeros((3, 8))),
        (np.zeros((3, 3)), np.zeros((2, 8))),
        (np.zeros((3, 3)), np.zeros((3, 4))),
        (np.zeros(3), np.zeros((3, 8))),
    ):
        with pytest.raises(InputError, match="semantic map"):
            SemanticMap().update(points.astype(np.float32), probabilities.astype(np.float32))


def test_columns_rebuilt_are_as_if_their_frames_had_been_there_from_the_start() -> None:
    rng = np.random.default_rng(0)
    frames = [cloud(*rng.uniform((x, -0.2, 0), (x + 0.8, 0.2, 1), (400, 3))) for x in (-1.0, -0.8, 0.0, 5.0)]
    there = [frame + np.float32([0.3 * (k == 1), 0, 0]) for k, frame in enumerate(frames)]
    labels = one_hot(*rng.integers(0, 8, 400))
    boxes = np.array([(frame.min(axis=0), frame.max(axis=0)) for frame in (frames[1], there[1])])
    semantic_map, expected = SemanticMap(), SemanticMap()
    for k, (frame, now) in enumerate(zip(frames, there, strict=True)):
        semantic_map.update(frame, labels, keyframe=k)
        expected.update(now, labels, keyframe=k)
    with semantic_map.rebuilding(boxes) as meets:
        are_met = meets(np.array([(now.min(axis=0), now.max(axis=0)) for now in there]))
        for k in np.flatnonzero(are_met):
            semantic_map.update(there[k], labels, keyframe=k)
    assert are_met.tolist() == [True, True, True, False]
    for values in ("points", "probabilities", "hits", "labels"):
        np.testing.assert_array_equal(getattr(semantic_map, values)(), getattr(expected, values)())
    semantic_map.update(frames[0], labels)
    expected.update(frames[0], labels)
    np.testing.assert_array_equal(semantic_map.points(), expected.points())
