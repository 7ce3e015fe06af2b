"""Lidars that there are, and refusals of those that there are not."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipeline.errors import InputError
from sarsim.commands.cli import run_guarded
from sarsim.commands.settings import settings_from
from sarsim.plugins.lidar.config import PRESETS, LidarConfig
from sarsim.settings import EpisodeConfig
from tests.refusal import refusal


def test_rows_and_columns_are_spread_over_the_view():
    model = LidarConfig("3x8").model()
    assert model.elevations == (-15, 0, 15)
    assert_allclose(model.azimuths, np.arange(-4, 4) * math.pi / 4)
    assert model.column_time == pytest.approx(1 / 80)


def test_a_field_of_view_has_a_column_at_either_end():
    model = LidarConfig("1x5", horizontal=180, rate=5).model()
    assert model.elevations == (0,)
    assert_allclose(model.azimuths, np.array([-2, -1, 0, 1, 2]) * math.pi / 4)
    assert model.column_time == pytest.approx(1 / 40)


def test_flags_change_a_preset():
    model = LidarConfig("vlp-16", range=(1, 20), vertical=(-30, 0), rate=5).model()
    assert (model.range, model.rate, model.columns) == ((1, 20), 5, PRESETS["vlp-16"].columns)
    assert model.elevations[::5] == pytest.approx((-30, -20, -10, 0))
    assert LidarConfig("3x8", vertical=(5, -20, 0)).model().elevations == (5, -20, 0)


def test_another_range_does_not_change_the_noise_at_a_distance():
    # The noise of the OS1-64 grows from 0.015 m by 0.085 m in 120 m.
    assert LidarConfig("os1-64", range=(0.5, 60)).model().sigma == pytest.approx((0.015, 0.0575))
    assert LidarConfig("os1-64", range=(0.5, 240)).model().sigma == pytest.approx((0.015, 0.185))
    assert LidarConfig("os1-64", range=(0.5, 60), sigma=(0.0, 0.1)).model().sigma == (0.0, 0.1)


def test_the_planar_scanner_has_a_beam_every_quarter_degree():
    azimuths = np.degrees(PRESETS["utm-30lx"].azimuths)
    assert_allclose(np.diff(azimuths), 0.25)
    assert_allclose(azimuths[[0, 540, -1]], [-135, 0, 135], atol=1e-9)


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        (["--lidar", "hdl-64"], "--lidar hdl-64: must be vlp-16, os1-64, utm-30lx, or rows and columns"),
        (["--lidar", "0x900"], "--lidar 0x900: a lidar needs at least one row and one column"),
        (["--lidar", "16x0"], "--lidar 16x0: a lidar needs at least one row and one column"),
        (["--lidar", "9999x9999"], "--lidar 9999x9999: a scan may have at most"),
        (["--lidar", "16x900", "--lidar-vertical", "5", "5"], "rows overlap"),
        (["--lidar", "3x9", "--lidar-vertical", "0", "1", "0"], "--lidar-vertical 0 1 0: rows overlap"),
        (["--lidar", "4x9", "--lidar-vertical", "0", "1", "2"], "one for each of the 4 rows"),
        (["--lidar", "2x9", "--lidar-vertical", "-91", "0"], "elevations must be between -90° and 90°"),
        (["--lidar", "2x9", "--lidar-horizontal", "361"], "--lidar-horizontal 361: columns overlap"),
        (["--lidar", "2x9", "--lidar-horizontal", "0"], "--lidar-horizontal 0: "),
        (["--lidar-range", "0", "10"], "--lidar-range 0 10: must be above 0"),
        (["--lidar-range", "-1", "10"], "--lidar-range -1 10: must be above 0"),
        (["--lidar-range", "10", "1"], "--lidar-range 10 1: must be above 0, finite, the nearer one first"),
        (["--lidar-range", "1", "inf"], "--lidar-range 1 inf: must be above 0, finite"),
        (["--lidar-range", "nan", "1"], "--lidar-range nan 1: "),
        (["--lidar-rate", "0"], "--lidar-rate 0: must be above 0"),
        (["--lidar-rate", "nan"], "--lidar-rate nan: must be above 0"),
    ],
)
def test_what_is_no_lidar_is_a_line(words, fault, capsys):
    line = refusal(capsys, run_guarded, lambda: settings_from(EpisodeConfig, words))
    assert line.startswith("error: --lidar")
    assert fault in line


@pytest.mark.parametrize(
    "wrong",
    [
        {"sigma": (-1.0, 0.0)},
        {"sigma": (0.0, math.nan)},
        {"detection_range": 0.0},
        {"detection_probability": 0.0},
        {"detection_probability": 1.5},
    ],
)
def test_numbers_of_a_file_are_checked_too(wrong):
    with pytest.raises(InputError, match="|".join(wrong)):
        LidarConfig(**wrong)
