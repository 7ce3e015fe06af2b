import numpy as np
import pytest

from pipeline.labels import Label
from pipeline.segments.cells import cells_of
from pipeline.segments.plane import Moments
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segments import Segments
from sarsim.scoring.segments import score_segments
from tests.sarsim.true_planes import faces_of_scene


@pytest.fixture(scope="module")
def faces():
    return faces_of_scene()


def segments_of(label, points, viewer):
    moments = Moments.of(points)
    patch = PlanePatch(
        label, moments.fit(np.array(viewer) - moments.centroid)[0], moments, points, cells_of(points)[0]
    )
    segments = Segments()
    segments.update([patch], 0)
    return segments


def wall_points(y_max):
    y, z = np.meshgrid(np.arange(-1, y_max, 0.01), np.arange(0, 1, 0.01))
    return np.column_stack([np.full(y.size, 0.98), y.ravel(), z.ravel()]).astype(np.float32)


def test_a_whole_wall_fits_and_half_of_it_fits_half(faces):
    for y_max, expected in ((1.0, 1.0), (0.0, 0.5)):
        report = score_segments(segments_of(Label.WALL, wall_points(y_max), (0, 0, 0.5)), faces)
        assert report["boxes_iou"]["median"] == pytest.approx(expected, abs=0.02)
        assert report["angle_error_deg"]["median"] < 0.01
        assert report["matched"] == 1


def test_a_wall_seen_from_the_wrong_side_or_of_another_label_matches_nothing(faces):
    for label, viewer in ((Label.WALL, (5, 0, 0.5)), (Label.CEILING, (0, 0, 0.5))):
        segments = segments_of(label, wall_points(1.0) - np.float32([0.2, 0, 0]), viewer)
        assert score_segments(segments, faces)["matched"] == 0
