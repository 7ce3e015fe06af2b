import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import MultiPoint

from pipeline.geometry.cells import cells_of
from pipeline.geometry.planes import Moments
from pipeline.labels import Label
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segments import Segments
from sarsim.ground_truth.faces import Face
from sarsim.scoring.segments import STRIDE, SegmentScore, row_ends
from tests.sarsim.true_planes import faces_of_scene

FRONT = 0.98
"""m; x of the front of the wall in the scene, which runs from y = -1 to 1 and is 1 m high."""
WALL = 1
"""Geom id of the wall."""


def segments_of(label, points, viewer):
    moments = Moments.of(points)
    patch = PlanePatch(
        label, moments.fit(np.array(viewer) - moments.centroid)[0], moments, points, cells_of(points, 0.05)[0]
    )
    segments = Segments()
    segments.update([patch], 0, np.eye(4))
    return segments


def wall_points(y_min=-1.0, y_max=1.0):
    y, z = np.meshgrid(np.arange(y_min + 0.0025, y_max, 0.005), np.arange(0.0025, 1, 0.005))
    return np.column_stack([np.full(y.size, FRONT), y.ravel(), z.ravel()]).astype(np.float32)


def panel(geom, y_min, y_max, height=1.0):
    """The front of a panel in the plane of the wall."""
    corners = [(FRONT, y_min, 0), (FRONT, y_max, 0), (FRONT, y_max, height), (FRONT, y_min, height)]
    return Face(geom, Label.WALL, np.array([-1.0, 0.0, 0.0]), np.array(corners))


def iou(score, *stretch, viewer=(0, 0, 0.5)):
    """Median IoU of a segment on a stretch of the wall."""
    return score.report(segments_of(Label.WALL, wall_points(*stretch), viewer))["boxes_iou"]["median"]


def seen(faces, *views):
    """The score of faces after ``views``, which are pairs of a geom and its seen points."""
    score = SegmentScore(faces)
    for geom, points in views:
        every = np.repeat(points, STRIDE, axis=0)
        score.add(every, np.full(len(every), geom, np.int32))
    return score


def test_a_whole_wall_fits_and_half_of_it_fits_half():
    score = seen(faces_of_scene(), (WALL, wall_points()))
    for y_max, expected in ((1.0, 1.0), (0.0, 0.5)):
        report = score.report(segments_of(Label.WALL, wall_points(-1, y_max), (0, 0, 0.5)))
        assert report["boxes_iou"]["median"] == pytest.approx(expected, abs=0.02)
        assert report["angle_error_deg"]["median"] < 0.01
        assert report["matched"] == 1


def test_a_segment_is_compared_with_what_came_into_view():
    score = seen(faces_of_scene(), (WALL, wall_points(-1, 0.2)))
    assert iou(score, -1, 0.2) == pytest.approx(1, abs=0.02)
    assert iou(score, -1, 1) == pytest.approx(0.6, abs=0.02)
    assert iou(seen(faces_of_scene()), -1, 1) == 0


def test_the_panels_of_a_wall_are_one_surface():
    panels = [panel(0, -1, 0), panel(1, 0, 1, height=2.4)]
    views = (0, wall_points(-1, 0)), (1, wall_points(0, 1))
    assert iou(seen(panels, *views), -1, 1) == pytest.approx(1, abs=0.02)
    assert iou(seen(panels[:1], *views), -1, 1) == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(("gap", "expected"), [(0.05, 1.0), (0.4, 0.4)])
def test_what_was_seen_far_apart_is_two_pieces(gap, expected):
    views = (0, wall_points(-1, -gap / 2)), (0, wall_points(gap / 2, 1))
    assert iou(seen([panel(0, -1, 1)], *views), -1, 1) == pytest.approx(expected, abs=0.02)


def test_the_back_of_a_thin_panel_is_not_its_front():
    back = Face(0, Label.WALL, np.array([1.0, 0.0, 0.0]), panel(0, -1, 1).outline + np.array([0.02, 0, 0]))
    score = seen([panel(0, -1, 1), back], (0, wall_points(-1, 0)), (0, wall_points() + np.float32([0.02, 0, 0])))
    assert iou(score, -1, 0) == pytest.approx(1, abs=0.02)
    assert iou(score, -1, 1, viewer=(5, 0, 0.5)) == pytest.approx(1, abs=0.02)


def test_faces_of_an_earlier_map_count_as_they_are():
    score = SegmentScore([panel(0, -1, 0), panel(1, 0, 1)], are_whole=True)
    assert iou(score, -1, 1) == pytest.approx(0.5, abs=0.02)


def test_a_wall_seen_from_the_wrong_side_or_of_another_label_matches_nothing():
    score = seen(faces_of_scene(), (WALL, wall_points()))
    for label, viewer in ((Label.WALL, (5, 0, 0.5)), (Label.CEILING, (0, 0, 0.5))):
        segments = segments_of(label, wall_points() - np.float32([0.2, 0, 0]), viewer)
        assert score.report(segments)["matched"] == 0


@given(st.sets(st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=1))
def test_the_ends_of_rows_have_the_hull_of_all_cells(cells):
    every = np.array(sorted(cells))
    ends = row_ends(every)
    assert MultiPoint(ends).convex_hull.equals(MultiPoint(every).convex_hull)
    assert len(ends) <= 2 * len(np.unique(every[:, 0]))
