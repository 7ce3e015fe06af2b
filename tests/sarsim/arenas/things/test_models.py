"""Signs, codes, tags, extinguishers and levers as MJCF, and their pictures as a camera sees them."""

import cv2
import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipeline.labels import Label
from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.things.codes import TAG_DICTIONARY
from sarsim.arenas.things.dolls import doll
from sarsim.arenas.things.hazmat import SignStyle, sign_face
from sarsim.arenas.things.models import april_tag, door_lever, fire_extinguisher, hazmat_sign, qr_code
from sarsim.arenas.things.thing import things_of
from sarsim.sensors.camera import geom_labels
from sarsim.sensors.rendering import Renderer

FACING_SOUTH = np.array([(1.0, 0, 0), (0, 0, -1.0), (0, 1.0, 0)])
THINGS = (
    (hazmat_sign("sign", "corrosive", 0.2, SignStyle(), paper=0.02), (-0.4, 0.59, 0.8), FACING_SOUTH),
    (qr_code("code_7", "wall 7", 0.14), (0.0, 0.59, 0.8), FACING_SOUTH),
    (april_tag("tag", 77, 0.16), (0.4, 0.59, 0.8), FACING_SOUTH),
    (door_lever("lever", 0.12, to_left=False), (-0.4, 0.59, 0.4), FACING_SOUTH),
    (fire_extinguisher("bottle", 0.07, 0.42, 0, 0), (0.4, 0.4, 0.0), np.eye(3)),
    (doll("victim_1", "alive", np.random.default_rng(1)), (0.0, 0.0, 0.4), np.eye(3)),
)


@pytest.fixture(scope="module")
def world():
    builder = ArenaBuilder("things")
    builder.add_element("small_wall", (0, 0, 0), 0)
    builder.add_floor((-2, -2), (2, 2))
    builder.add_surroundings((-2, -2), (2, 2))
    for thing, position, R in THINGS:
        builder.add_thing(thing, position, R)
    model = mujoco.MjModel.from_xml_string(builder.to_xml(), builder.files)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.fixture(scope="module")
def photo(world):
    """The wall from 1.2 m."""
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = (0, 0.59, 0.6), 1.2, 90, 0
    with Renderer(world[0]) as renderer:
        return renderer.colour(world[1], camera), renderer.segmentation_and_depth(world[1], camera)[0]


def test_they_are_what_they_say(world):
    model, data = world
    found = {t.name: t for t in things_of(model, data)}
    said = [(n, t.kind, t.text, t.state) for n, t in found.items()]
    assert said == [
        ("victim_1", "victim", "", "alive"),
        ("sign", "hazmat_sign", "corrosive", ""),
        ("code_7", "qr_code", "wall 7", ""),
        ("tag", "april_tag", "77", ""),
        ("lever", "door_lever", "", ""),
        ("bottle", "fire_extinguisher", "", ""),
    ]
    for name in ("sign", "code_7", "tag"):
        assert_allclose(found[name].normal, (0, -1, 0), atol=1e-6)
    assert_allclose(np.ptp(found["sign"].box, axis=0)[:2], 0.2 * np.sqrt(2), atol=1e-4)
    assert_allclose(np.ptp(found["bottle"].box, axis=0)[2], 0.42, atol=0.01)


def test_only_the_doll_is_a_victim_and_paper_collides_with_nothing(world):
    model, data = world
    labels = geom_labels(model)
    for thing in things_of(model, data):
        assert set(labels[thing.geoms]) == {Label.VICTIM if thing.kind == "victim" else Label.CLUTTER}
        flat = thing.kind in ("hazmat_sign", "qr_code", "april_tag")
        assert set(model.geom_contype[thing.geoms]) == {0 if flat else 1}
    for body in ("backing_sign", "backing_victim_1"):
        assert set(labels[model.geom_bodyid == model.body(body).id]) <= {Label.CLUTTER}


def test_a_camera_reads_code_and_tag(photo):
    image, _ = photo
    assert cv2.QRCodeDetector().detectAndDecode(image)[0] == "wall 7"
    _, ids, _ = cv2.aruco.ArucoDetector(TAG_DICTIONARY).detectMarkers(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
    assert ids.ravel().tolist() == [77]


def test_a_camera_sees_the_sign_upright(world, photo):
    image, geom = photo
    own = np.isin(geom, next(t for t in things_of(*world) if t.name == "sign").geoms)
    rows, columns = np.nonzero(own)
    top, bottom, left, right = rows.min(), rows.max(), columns.min(), columns.max()
    corners = [((left + right) / 2, top), (right, (top + bottom) / 2), ((left + right) / 2, bottom)]
    M = cv2.getAffineTransform(np.array(corners, np.float32), np.array([(0, 0), (63, 0), (63, 63)], np.float32))
    seen = cv2.warpAffine(image, M, (64, 64)).astype(float).mean(axis=2).ravel()
    drawn = [np.rot90(sign_face("corrosive", 64), k).astype(float).mean(axis=2).ravel() for k in range(4)]
    alike = [np.corrcoef(seen, other)[0, 1] for other in drawn]
    assert alike[0] > 0.9 and max(alike[1:]) < 0.6
