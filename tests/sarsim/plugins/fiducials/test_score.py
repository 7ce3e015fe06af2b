"""Reading tags and scoring by them."""

from types import SimpleNamespace

import numpy as np
import pytest
from dm_control import mjcf
from numpy.testing import assert_allclose

from pipeline.frame import Frame, Intrinsics
from pipeline.transforms import from_yaw, inverse, transform_points
from sarsim.arenas.arena import RescueArena
from sarsim.arenas.things.codes import tag_picture
from sarsim.plugins.fiducials.score import FiducialScore, read_fiducials
from sarsim.plugins.fiducials.tags import hang_fiducials
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

HALL = """<mujoco><option timestep="0.002" integrator="implicitfast"/><size nuser_geom="1"/>
<visual><map znear="0.005" zfar="10"/></visual><worldbody>
<light pos="0 0 3" dir="0.2 0 -1"/>
<geom type="plane" size="8 8 0.1" user="2"/>
<geom type="box" size="0.01 3 0.6" pos="4 0 0.6" user="1" rgba="0.8 0.66 0.46 1"/>
<site name="start"/></worldbody></mujoco>"""
CAMERA = Intrinsics(640, 480, 550.0, 560.0, 320.0, 240.0)
T_BASE_CAMERA = np.array([(0, 0, 1, 0.17), (-1, 0, 0, 0), (0, -1, 0, 0.6), (0, 0, 0, 1)], np.float64)
"""Level, looking ahead."""


def frame(*tags: tuple[int, int, int, int], depth: float = 2.0) -> Frame:
    """A grey wall square to the camera with tags: number, left, top, and pixels of a module."""
    rgb = np.full((480, 640, 3), 128, np.uint8)
    for tag, left, top, module in tags:
        modules = tag_picture(tag)[8::16, 8::16]
        rgb[top : top + 10 * module, left : left + 10 * module] = np.kron(modules, np.ones((module, module)))[
            ..., None
        ]
    image = np.full((480, 640), depth, np.float32)
    return Frame(0.0, rgb, image, CAMERA, T_BASE_CAMERA, np.eye(4))


def in_base(left: int, top: int, module: int, depth: float = 2.0) -> np.ndarray:
    """(3,) m where the middle of such a tag is."""
    u, v = left + 5 * module, top + 5 * module
    return np.array([0.17 + depth, -depth * (u - 320) / 550, 0.6 - depth * (v - 240) / 560])


def tags_at(*places: np.ndarray) -> np.ndarray:
    """True poses of tags at places (3,)."""
    poses = np.tile(np.eye(4), (len(places), 1, 1))
    poses[:, :3, 3] = places
    return poses


def test_a_tag_is_where_its_middle_and_its_depth_are():
    ((tag, middle),) = read_fiducials(frame((7, 100, 200, 6)))
    assert tag == 7
    assert_allclose(T_BASE_CAMERA[:3, :3] @ middle + T_BASE_CAMERA[:3, 3], in_base(100, 200, 6), atol=1e-3)


def test_a_far_tag_without_depth_is_left_out():
    assert not read_fiducials(frame((7, 100, 200, 6), depth=0.0))
    half = frame((7, 100, 200, 6), (8, 400, 200, 6))
    half.depth[:, 300:] = 0
    assert [tag for tag, _ in read_fiducials(half)] == [7]


def test_a_tag_too_near_for_depth_is_as_far_as_it_is_large():
    """Modules of 2 cm and 16 pixels, at a focal length of 555 pixels."""
    ((_, middle),) = read_fiducials(frame((7, 240, 160, 16), depth=0.0))
    assert_allclose(middle, [0, 0, 0.02 * 555 / 16], atol=0.01)


class Seen(FiducialScore):
    """A score of keyframes that are made up."""

    def __init__(self, T_world_tag):
        self.keyframes = SimpleNamespace(poses=[])
        super().__init__(T_world_tag, self.keyframes)

    def see(self, frame, T_map_base):
        self.keyframes.poses.append(T_map_base)
        self.on_keyframe(SimpleNamespace(frame=frame, index=len(self.keyframes.poses) - 1))

    @property
    def report(self):
        return self.figures()["localisation"]


def test_the_error_is_that_of_the_distances():
    """Three tags; the true distances are shorter by 0.1, 0.2 and 0.3 m: RMS √(0.14 / 3)."""
    a, b, c = in_base(20, 200, 6), in_base(280, 200, 6), in_base(500, 200, 6)
    step = (b - a) / np.linalg.norm(b - a)
    score = Seen(tags_at(a, b - 0.1 * step, c - 0.3 * step))
    score.see(frame((0, 20, 200, 6), (1, 280, 200, 6), (2, 500, 200, 6)), np.eye(4))
    report = score.report
    assert report["fiducials_found"] == 3
    assert_allclose(report["fiducial_error_m"], np.sqrt(0.14 / 3), atol=2e-3)


def test_where_the_map_lies_does_not_matter():
    a, b = in_base(20, 200, 6), in_base(500, 100, 6)
    score = Seen(tags_at(a, b))
    score.see(frame((0, 20, 200, 6), (1, 500, 100, 6)), from_yaw(3.0, -5.0, 1.0, 2.0))
    assert score.report["fiducial_error_m"] < 2e-3


def test_keyframes_that_are_corrected_later_carry_their_tags_along():
    a, b = in_base(20, 200, 6), in_base(280, 200, 6) + np.array([1.0, 0, 0])
    score = Seen(tags_at(a, b))
    score.see(frame((0, 20, 200, 6)), np.eye(4))
    score.see(frame(), np.eye(4))
    score.see(frame((1, 280, 200, 6)), from_yaw(1.3, 0, 0, 0))
    wrong = np.linalg.norm(b - a + np.array([0.3, 0, 0])) - np.linalg.norm(b - a)
    assert_allclose(score.report["fiducial_error_m"], wrong, atol=2e-3)
    score.keyframes.poses[2] = from_yaw(1.0, 0, 0, 0)
    assert score.report["fiducial_error_m"] < 2e-3


def test_near_views_count_more():
    """A tag seen from 1 m at its true place and from 2 m at another one: the weights are 4 to 1."""
    near, far = in_base(300, 200, 12, 1.0), in_base(300, 200, 6, 2.0)
    ratio = np.linalg.norm(near - T_BASE_CAMERA[:3, 3]) / np.linalg.norm(far - T_BASE_CAMERA[:3, 3])
    score = Seen(tags_at(near))
    score.see(frame((0, 300, 200, 12), depth=1.0), np.eye(4))
    score.see(frame((0, 300, 200, 6), depth=2.0), np.eye(4))
    assert_allclose(score.positions()[0], (near + ratio**2 * far) / (1 + ratio**2), atol=2e-3)


def test_one_tag_has_no_distances_and_others_are_none_of_the_arena():
    score = Seen(tags_at(np.zeros(3), np.ones(3)))
    assert score.report == {"fiducials_found": 0}
    score.see(frame((0, 20, 200, 6), (2, 280, 200, 6)), np.eye(4))
    assert score.report == {"fiducials_found": 1}


@pytest.mark.parametrize(
    ("distance", "lighting", "tolerance"),
    [(0.6, "normal", 0.006), (1.0, "dark", 0.006), (2.0, "normal", 0.01), (3.0, "dark", 0.02)],
)
def test_tags_are_read_through_the_noise(distance, lighting, tolerance):
    errors = []
    for seed, bearing in enumerate((-0.6, 0.0, 0.6)):
        arena = RescueArena(mjcf.from_xml_string(HALL))
        T = hang_fiducials(arena, 1, seed)[0]
        eye = T[:2, 3] + distance * (np.cos(bearing) * T[:2, 2] + np.sin(bearing) * T[:2, 0])
        yaw = np.arctan2(*(T[:2, 3] - eye)[::-1]) + 0.1
        site = arena.mjcf_model.find("site", "start")
        site.pos = (*(eye - 0.17 * np.array([np.cos(yaw), np.sin(yaw)])), 0)
        site.quat = (np.cos(yaw / 2), 0, 0, np.sin(yaw / 2))
        robot = SimulatedRobot(arena, SimulationConfig(lighting=lighting), seed)
        seen = robot.sense()
        ((tag, middle),) = read_fiducials(seen)
        true = transform_points(inverse(robot.true_frame.T_world_base @ seen.T_base_camera), T[None, :3, 3])[0]
        errors.append(np.linalg.norm(middle - true))
        assert tag == 0
        robot.close()
    assert max(errors) < tolerance


def test_a_tag_changes_neither_label_nor_depth_of_its_wall():
    images = []
    for number in (0, 1):
        arena = RescueArena(mjcf.from_xml_string(HALL))
        hang_fiducials(arena, number, seed=0)
        site = arena.mjcf_model.find("site", "start")
        site.pos = (2.0, 0, 0)
        robot = SimulatedRobot(arena, SimulationConfig(), 0)
        robot.sense()
        images.append(robot.true_frame.image)
        robot.close()
    bare, tagged = images
    np.testing.assert_array_equal(bare.label, tagged.label)
    assert_allclose(bare.depth, tagged.depth, atol=0.003)
