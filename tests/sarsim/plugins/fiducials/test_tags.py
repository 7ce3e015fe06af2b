import cv2
import mujoco
import numpy as np
import pytest
from dm_control import mjcf
from numpy.testing import assert_allclose

from pipeline.errors import InputError
from pipeline.labels import Label
from sarsim.arenas.arena import RescueArena
from sarsim.arenas.load import load_arena
from sarsim.arenas.things.codes import RESERVED_TAGS, TAG_DICTIONARY, TAG_SIDE, tag_picture
from sarsim.arenas.walls import VIEWING_DISTANCE
from sarsim.ground_truth.true_surface import Survey
from sarsim.plugins.fiducials.tags import TAG_SPACING, TAG_THICKNESS, hang_fiducials
from sarsim.sensors.camera import geom_labels

HALL = """<mujoco><size nuser_geom="1"/><worldbody>
<geom type="plane" size="5 5 0.1" user="2"/>
<geom name="wall" type="box" size="0.01 {half} 0.6" pos="2 0 0.6" user="1"/>
<geom type="box" size="0.1 0.1 0.3" pos="{box} 0 0.3" user="4"/>
<site name="start"/></worldbody></mujoco>"""


def hall(half: float = 1.0, box: float = -3.0) -> RescueArena:
    """A floor, a wall of so many metres on both sides of the x axis, and a box on the axis."""
    return RescueArena(mjcf.from_xml_string(HALL.format(half=half, box=box)))


def compiled(arena: RescueArena) -> tuple[mujoco.MjModel, mujoco.MjData]:
    root = arena.mjcf_model
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def test_pictures_are_tags_with_a_white_margin():
    detector = cv2.aruco.ArucoDetector(TAG_DICTIONARY)
    for tag in range(RESERVED_TAGS):
        image = tag_picture(tag)
        assert image.shape == (160, 160) and (image[:16] == 255).all() and (image[16:32, 16:-16] == 0).all()
        (corners,), ids, _ = detector.detectMarkers(np.pad(image, 40, constant_values=128))
        assert ids.item() == tag
        assert_allclose(corners[0], 40 + np.array([(16, 16), (143, 16), (143, 143), (16, 143)]), atol=1)


@pytest.mark.parametrize("name", ["nist_6x4", "esogu_52x15"])
def test_tags_hang_on_bare_walls_before_drivable_ground(name):
    arena = load_arena(name)
    before = Survey(*compiled(arena)).surface_from(arena.T_world_start[:3, 3])
    poses = hang_fiducials(arena, 8, seed=3)
    model, data = compiled(arena)
    assert poses.shape == (8, 4, 4)
    for tag, T in enumerate(poses):
        assert_allclose(T[:3, :3].T @ T[:3, :3], np.eye(3), atol=1e-9)
        assert_allclose(T[:3, 1], [0, 0, 1])
        eye, geom, normal = (
            T[:3, 3] + (VIEWING_DISTANCE - TAG_THICKNESS) * T[:3, 2],
            np.zeros(1, np.int32),
            np.zeros(3),
        )
        assert before.grid.at(before.drivable, eye)
        for right, up in TAG_SIDE / 2 * np.array([(0, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)]):
            start = eye + right * T[:3, 0] + up * T[:3, 1]
            distance = mujoco.mj_ray(model, data, start, -T[:3, 2], None, 1, -1, geom, normal)
            assert model.geom(geom[0]).name == f"fiducial_{tag}"
            assert distance == pytest.approx(VIEWING_DISTANCE - TAG_THICKNESS, abs=1e-6)
    places = poses[:, :3, 3]
    apart = np.linalg.norm(places[:, None] - places, axis=2)[np.triu_indices(8, 1)]
    assert apart.min() > TAG_SPACING
    assert (geom_labels(model)[[model.geom(f"fiducial_{tag}").id for tag in range(8)]] == Label.WALL).all()


def test_tags_change_nothing_of_the_true_ground():
    arena = load_arena("nist_6x4")
    start = arena.T_world_start[:3, 3]
    before = Survey(*compiled(arena)).surface_from(start)
    hang_fiducials(arena, 8, seed=0)
    after = Survey(*compiled(arena)).surface_from(start)
    for layer in ("height", "drivable", "walls"):
        np.testing.assert_array_equal(getattr(before, layer), getattr(after, layer))


def test_the_seed_says_where_they_hang():
    first, again, other = (hang_fiducials(hall(), 2, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.allclose(first, other)


def test_a_tag_faces_the_side_that_it_hangs_on():
    poses = hang_fiducials(hall(), 3, seed=0)
    for T in poses:
        side = np.sign(T[0, 3] - 2.0)
        assert_allclose(T[:3, :3], [(0, 0, side), (side, 0, 0), (0, 1, 0)], atol=1e-9)
        assert_allclose(T[0, 3], 2.0 + side * (0.01 + TAG_THICKNESS))
        assert T[2, 3] == pytest.approx(0.5)


def test_no_tag_hangs_behind_a_box():
    """The box reaches up to 0.6 m, 0.3 m before the wall's face; it and a tag are 0.2 m wide."""
    for seed in range(5):
        for T in hang_fiducials(hall(box=1.59), 3, seed):
            assert T[0, 2] > 0 or abs(T[1, 3]) > 0.2


def test_none_are_hung_where_none_are_asked_for():
    arena = hall()
    assert hang_fiducials(arena, 0, seed=0).shape == (0, 4, 4)
    assert arena.mjcf_model.find("geom", "fiducial_0") is None


@pytest.mark.parametrize(
    ("number", "half", "says"), [(-1, 1.0, "0 to 50"), (51, 1.0, "0 to 50"), (4, 0.2, "room for")]
)
def test_what_cannot_be_hung_is_an_input_error(number, half, says):
    with pytest.raises(InputError, match=f"--fiducials {number}: .*{says}"):
        hang_fiducials(hall(half), number, seed=0)
