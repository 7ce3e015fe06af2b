import mujoco
import numpy as np
import pytest

from pipeline.labels import Label
from sarsim.ground_truth.faces import true_faces
from tests.sarsim.true_planes import faces_of_scene


@pytest.fixture(scope="module")
def faces():
    return faces_of_scene()


def area(outline):
    return 0.5 * np.linalg.norm(
        sum(np.cross(a, b) for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True))
    )


def test_planes_boxes_and_wedges_have_their_faces(faces):
    by_label = {label: [f for f in faces if f.label == label] for label in Label}
    assert [len(by_label[n]) for n in (Label.TERRAIN, Label.WALL, Label.INCLINED_RAMP, Label.CLUTTER)] == [1, 6, 5, 0]
    assert area(by_label[Label.TERRAIN][0].outline) == pytest.approx(24)
    slope = max(by_label[Label.INCLINED_RAMP], key=lambda f: f.normal[2])
    assert np.degrees(np.arccos(slope.normal[2])) == pytest.approx(16.07, abs=0.01)
    assert area(slope.outline) == pytest.approx(1.2 * np.hypot(0.59, 0.17), rel=1e-3)
    assert slope.outline[:, 0].min() == pytest.approx(-1, abs=1e-6)


def test_a_tetrahedron_has_four_faces():
    scene = """<mujoco><size nuser_geom="1"/><asset><mesh name="tip" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/></asset>
    <worldbody><geom type="mesh" mesh="tip" user="3"/></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(scene)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    areas = sorted(area(face.outline) for face in true_faces(model, data))
    assert areas == pytest.approx([0.5, 0.5, 0.5, np.sqrt(3) / 2])


def test_the_face_of_an_infinite_plane_reaches_a_distant_wall():
    scene = """<mujoco><size nuser_geom="1"/><worldbody><geom type="plane" size="0 0 1" user="2"/>
    <geom type="box" pos="60 0 1" size="0.1 2 1" user="1"/></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(scene)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    (floor,) = (face for face in true_faces(model, data) if face.label == Label.TERRAIN)
    assert floor.normal[2] == 1
    assert floor.outline[:, 0].max() > 60.1
    assert area(floor.outline) == pytest.approx(2500)
