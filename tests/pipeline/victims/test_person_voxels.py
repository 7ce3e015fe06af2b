"""The voxels that observations of one person agree on."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.victims.people import PersonVoxels

VOXEL = 0.03  # m


def at(*voxels: tuple[int, int, int]) -> PersonVoxels:
    """An observation of points in the middle of these voxels."""
    return PersonVoxels.of(((np.array(voxels) + 0.5) * VOXEL).astype(np.float32), VOXEL)


def cells(points: np.ndarray) -> set[tuple[int, ...]]:
    return {tuple(map(int, voxel)) for voxel in np.floor(points / VOXEL)}


def test_one_point_is_kept_of_a_voxel() -> None:
    points = np.array([(0.001, 0, 0), (0.002, 0, 0), (VOXEL + 0.001, 0, 0)], np.float32)
    voxels = PersonVoxels.of(points, VOXEL)
    np.testing.assert_array_equal(voxels.points, points[[0, 2]])
    assert voxels.counts.tolist() == [1, 1]


def test_what_few_frames_show_is_not_of_the_person() -> None:
    body, wall = (0, 0, 0), (9, 0, 0)
    voxels = PersonVoxels.joined([at(body), at(body, wall)])
    assert cells(voxels.agreed_points(1.0)) == {body, wall}
    assert cells(voxels.agreed_points(1.2)) == {body}


def test_what_never_agrees_is_kept_whole() -> None:
    assert len(PersonVoxels.joined([at((k, 0, 0)) for k in range(40)]).agreed_points(40)) == 40


SOME = st.lists(st.tuples(*[st.integers(-3, 3)] * 3), min_size=1, max_size=6, unique=True)


@given(st.lists(SOME, min_size=2, max_size=5))
def test_the_order_of_joining_does_not_matter(shown: list[list[tuple[int, int, int]]]) -> None:
    observations = [at(*voxels) for voxels in shown]
    at_once, one_by_one = PersonVoxels.joined(observations), observations[0]
    for voxels in observations[1:]:
        one_by_one = PersonVoxels.joined([one_by_one, voxels])
    assert dict(zip(map(tuple, at_once.points), at_once.counts, strict=True)) == dict(
        zip(map(tuple, one_by_one.points), one_by_one.counts, strict=True)
    )
