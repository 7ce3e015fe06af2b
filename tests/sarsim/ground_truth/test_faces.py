import mujoco
import numpy as np
import pytest

from pipeline.labels import Label
from pipeline.segments.cells import cells_of
from pipeline.segments.plane import Moments
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segments import Segments
from sarsim.ground_truth.faces import score_segments, true_faces

SCENE = """
<mujoco>
  <size nuser_geom="1"/>
  <asset>
    <mesh name="ramp" vertex="0 -0.6 0  0 0.6 0  0.59 -0.6 0  0.59 0.6 0  0.59 -0.6 0.17  0.59 0.6 0.17"/>
  </asset>
  <worldbody>
    <geom type="plane" size="3 2 0.1" user="2"/>
    <geom type="box" pos="1 0 0.5" size="0.02 1 0.5" user="1"/>
    <geom type="mesh" mesh="ramp" pos="-1 0 0" user="3"/>
    <geom type="box" pos="-2 1 0.1" size="0.1 0.1 0.1" user="7"/>
    <geom type="sphere" pos="0 1 1" size="0.1" user="1"/>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def faces():
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return true_faces(model, data)


def area(outline):
    return 0.5 * np.linalg.norm(
        sum(np.cross(a, b) for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True))
    )


def test_planes_boxes_and_wedges_have_their_faces(faces):
    by_label = {label: [f for f in faces if f.label == label] for label in Label}
    assert [len(by_label[n]) for n in (Label.TERRAIN, Label.WALL, Label.INCLINED_RAMP, Label.CLUTTER)] == [
        1,
        6,
        5,
        0,
    ]
    assert area(by_label[Label.TERRAIN][0].outline) == pytest.approx(24)
    slope = max(by_label[Label.INCLINED_RAMP], key=lambda f: f.normal[2])
    assert np.degrees(np.arccos(slope.normal[2])) == pytest.approx(16.07, abs=0.01)
    assert area(slope.outline) == pytest.approx(1.2 * np.hypot(0.59, 0.17), rel=1e-3)
    assert slope.outline[:, 0].min() == pytest.approx(-1, abs=1e-6)


def segments_of(label, points, viewer):
    moments = Moments.of(points)
    patch = PlanePatch(
        label,
        moments.fit(np.array(viewer) - moments.centroid)[0],
        moments,
        points,
        cells_of(points)[0],
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
