"""Warm regions of a thermal image."""

import numpy as np

from pipeline.victims.config import HeatConfig
from pipeline.victims.readers import warm_regions

CONFIG = HeatConfig(min_temperature_excess=5.0)


def test_what_is_warm_is_outlined_in_the_colour_image_and_noise_is_not():
    thermal = 20 + np.random.default_rng(0).normal(0, 0.05, (60, 80)).astype(np.float32)
    thermal[20:26, 30:40] = 34
    thermal[50, 70] = 90  # one hot spot
    thermal[0, 0] = np.nan
    (reading,) = warm_regions(thermal, (480, 640), CONFIG)
    assert reading.kind == "heat"
    assert reading.box == (244, 164, 316, 204)  # through the middles of its outermost pixels
    assert list(warm_regions(np.full((60, 80), 30, np.float32), (480, 640), CONFIG)) == []


def test_heat_is_where_it_is_in_a_colour_image_of_another_shape():
    thermal = np.full((60, 80), 20, np.float32)
    thermal[20:26, 30:40] = 34
    (reading,) = warm_regions(thermal, (360, 640, 3), CONFIG)
    assert reading.box == (244, 123, 316, 153)
