"""Planes of synthetic frames."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.labels import Label
from pipeline.segments.config import SegmentsConfig
from pipeline.segments.planar_regions import planar_regions
from pipeline.segments.planes import PlanePatch, find_planes
from pipeline.segments.surfels_kernels import NONE
from tests.pipeline.polygon_scene import Face, floor, look, pose, wall, wedge

ROOM = [
    floor(0, 4, 0, 4),
    wall((3, 4), (3, 0)),
    wall((0, 3.5), (4, 3.5)),
    *wedge(1.6, 1.6, 0.6, 1.2, 0.17),
    floor(2.2, 3, 1.0, 2.2, z=0.17, label=Label.STRAIGHT_RAMP),
]
CORNER_VIEW = pose(0.3, 0.4, 0.6, 0.6, 0.25)


def planes_of(faces: list[Face], T: np.ndarray, sigma: float = 0.01, seed: int = 1) -> list[PlanePatch]:
    frame = look(faces, T, sigma)
    return find_planes(frame, frame.label[frame.returns], T, seed, SegmentsConfig())


def angle_error(patch: PlanePatch, normal: np.ndarray) -> float:
    return np.rad2deg(np.arccos(min(abs(patch.plane.normal @ normal), 1)))


def test_room_with_a_ramp_and_a_deck() -> None:
    patches = planes_of(ROOM, CORNER_VIEW)
    slope = np.array([-0.17, 0, 0.6]) / np.hypot(0.17, 0.6)
    expected = {
        (Label.TERRAIN, (0, 0, 1)): 0,
        (Label.WALL, (-1, 0, 0)): 3,
        (Label.WALL, (0, -1, 0)): -3.5,
        (Label.INCLINED_RAMP, tuple(slope)): slope @ (1.6, 0, 0),
        (Label.INCLINED_RAMP, (0, -1, 0)): -1,
        (Label.STRAIGHT_RAMP, (0, 0, 1)): 0.17,
    }
    errors = []
    for (label, normal), offset in expected.items():
        near = [p for p in patches if p.label == label and angle_error(p, np.array(normal)) < 5]
        assert near, (label, normal)
        best = max(near, key=lambda p: len(p.points))
        errors.append(angle_error(best, np.array(normal)))
        assert abs(best.plane.offset) == pytest.approx(abs(offset), abs=0.01)
        assert best.plane.distance(CORNER_VIEW[None, :3, 3])[0] > 0
    assert np.median(errors) <= 0.5
    assert len(patches) == len(expected)


def test_points_lie_on_the_plane_in_their_cells_and_moments_are_of_the_surface() -> None:
    for patch in planes_of(ROOM, CORNER_VIEW):
        assert np.abs(patch.plane.distance(patch.points)).max() < 0.01
        assert abs(patch.plane.distance(patch.moments.centroid[None])[0]) < 1e-6
        # Centres of cells lie at multiples of their size.
        held = np.unique(np.floor((patch.points + 0.025) / 0.05).astype(int), axis=0)
        assert len(patch.cells) == pytest.approx(len(held), abs=2)


def test_many_parallel_ramps_are_slopes_not_a_level_cut_through_them() -> None:
    ramps = [face for i in range(4) for face in wedge(0.9 + 0.6 * i, 0, 0.6, 2.0, 0.17)]
    patches = planes_of([floor(0, 4, -2, 2), *ramps], pose(0, 0, 0.9, 0.0, 0.4))
    slopes = [p for p in patches if p.label == Label.INCLINED_RAMP]
    assert len(slopes) == 4
    for patch in slopes:
        assert np.rad2deg(np.arccos(patch.plane.normal[2])) == pytest.approx(15.8, abs=0.5)


@pytest.mark.parametrize("gap", [0.4, 0.8])
def test_walls_of_one_plane_with_a_door_between_are_two(gap: float) -> None:
    door = [wall((2, 2), (2, gap / 2)), wall((2, -gap / 2), (2, -2))]
    walls = [p for p in planes_of([floor(0, 4, -2, 2), *door], pose(0, 0, 0.6, 0, 0.1)) if p.label == Label.WALL]
    assert len(walls) == 2
    assert sorted(np.sign(p.moments.centroid[1]) for p in walls) == [-1, 1]


def test_wall_before_a_wall_is_two_walls() -> None:
    patches = planes_of([wall((1.5, 0), (1.5, -2)), wall((1.7, 2), (1.7, -2))], pose(0, 0, 0.6, 0))
    assert sorted(round(-p.plane.offset, 2) for p in patches) == [1.5, 1.7]


def test_planes_in_the_cameras_frame_face_it() -> None:
    frame = look(ROOM, CORNER_VIEW)
    found = planar_regions(frame, frame.label * frame.returns, 0, SegmentsConfig().angle)
    assert len(found.planes) >= 6
    assert np.linalg.norm(found.planes[:, :3], axis=1) == pytest.approx(1)
    assert (found.planes[:, 3] < 0).all()
    on_plane = found.plane_of_surfel != NONE
    n, d = np.split(found.planes[found.plane_of_surfel[on_plane]], [3], axis=1)
    assert np.abs((n * found.surfels.points[on_plane]).sum(axis=1) - d[:, 0]).max() < 0.025


def test_classes_without_planes_have_none() -> None:
    frame = look(ROOM, CORNER_VIEW)
    labels = np.full(np.count_nonzero(frame.returns), Label.CLUTTER, np.uint8)
    assert find_planes(frame, labels, CORNER_VIEW, 0, SegmentsConfig()) == []


def test_a_frame_without_returns() -> None:
    assert planes_of([floor(90, 99, 90, 99)], CORNER_VIEW, sigma=0) == []


def test_labels_of_another_frame_are_refused() -> None:
    frame = look(ROOM, CORNER_VIEW)
    with pytest.raises(InputError, match="labels"):
        find_planes(frame, np.zeros(5, np.uint8), CORNER_VIEW, 0, SegmentsConfig())


def test_moving_the_map_moves_the_planes() -> None:
    frame: Frame = look(ROOM, CORNER_VIEW, 0.01)
    labels = frame.label[frame.returns]
    T = pose(0, 0, 0, 0.9)[:3, :3] @ pose(0, 0, 0, 0.0)[:3, :3].T
    moved = CORNER_VIEW.copy()
    moved[:3, :3], moved[:3, 3] = T @ CORNER_VIEW[:3, :3], T @ CORNER_VIEW[:3, 3] + [5, -3, 1]
    pairs = zip(*(find_planes(frame, labels, at, 0, SegmentsConfig()) for at in (CORNER_VIEW, moved)), strict=True)
    for a, b in pairs:
        assert b.plane.normal == pytest.approx(T @ a.plane.normal, abs=1e-3)


@pytest.mark.parametrize("seed", [2**32, 10**30])
def test_any_seed_is_one(seed: int) -> None:
    assert len(planes_of(ROOM, CORNER_VIEW, seed=seed)) == len(planes_of(ROOM, CORNER_VIEW))


def test_same_seed_gives_the_same_planes() -> None:
    once, again = planes_of(ROOM, CORNER_VIEW), planes_of(ROOM, CORNER_VIEW)
    for a, b in zip(once, again, strict=True):
        assert np.array_equal(a.plane.normal, b.plane.normal)
        assert np.array_equal(a.points, b.points)
