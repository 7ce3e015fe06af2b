from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from pipeline.frame import Intrinsics
from sarsim.scoring.visibility import MIN_VISIBLE_PIXELS, Visibility
from sarsim.sensors.camera import LabelledImage

MODEL = '<mujoco><worldbody><geom size="1"/><geom size="1"/><geom size="1"/><geom size="1"/></worldbody></mujoco>'


@dataclass
class Own:
    geoms: np.ndarray


@pytest.fixture
def visibility():
    """Of two things, made of geoms 0 and 2, and of geom 3."""
    return Visibility(mujoco.MjModel.from_xml_string(MODEL), [Own(np.array([0, 2])), Own(np.array([3]))])


def image(*pixels):
    """An image in which each geom shows so many pixels."""
    instance = np.full(1600, -1, np.int32)
    instance[: sum(pixels)] = np.repeat(np.arange(len(pixels)), pixels)
    instance, eye = instance.reshape(40, 40), np.eye(4)
    depth, label = np.ones((40, 40), np.float32), np.zeros((40, 40), np.uint8)
    rgb = np.zeros((40, 40, 3), np.uint8)
    return LabelledImage(rgb, depth, label, instance, Intrinsics(40, 40, 1, 1, 1, 1), eye, eye)


def test_the_geoms_of_a_thing_count_together_and_others_do_not(visibility):
    visibility.add(image(MIN_VISIBLE_PIXELS // 2, 700, MIN_VISIBLE_PIXELS // 2 - 1, MIN_VISIBLE_PIXELS - 1))
    assert_array_equal(visibility.visible, [False, False])
    visibility.add(image(MIN_VISIBLE_PIXELS // 2, 700, MIN_VISIBLE_PIXELS // 2, 0))
    assert_array_equal(visibility.visible, [True, False])
    visibility.add(image(0, 0, 0, MIN_VISIBLE_PIXELS))
    assert_array_equal(visibility.visible, [True, True])


def test_pixels_without_depth_show_nothing(visibility):
    visibility.add(replace(image(MIN_VISIBLE_PIXELS), depth=np.zeros((40, 40), np.float32)))
    assert not visibility.visible.any()
