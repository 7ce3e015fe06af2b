"""The map's own file, and what it refuses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.io.npz import load_metric_map, save_metric_map
from pipeline.metric_map.metric_map import MetricMap
from tests.pipeline.metric_map.box_room import CAMERA, depth_image, tour


@pytest.fixture(scope="module")
def explored():
    metric_map = MetricMap(MetricMapConfig(voxel_size=0.2))
    for T in tour(4):
        metric_map.integrate(depth_image(T), CAMERA, T)
    return metric_map


@pytest.fixture(scope="module")
def written(explored, tmp_path_factory):
    path = tmp_path_factory.mktemp("map") / "map.npz"
    save_metric_map(explored, path)
    return path.read_bytes()


def test_a_map_comes_back_with_its_settings_and_goes_on(explored, tmp_path):
    save_metric_map(explored, tmp_path / "map.npz")
    again = load_metric_map(tmp_path / "map.npz")
    assert again.config == explored.config
    np.testing.assert_array_equal(again.log_odds(*explored.bounds()), explored.log_odds(*explored.bounds()))
    assert [p.name for p in tmp_path.iterdir()] == ["map.npz"]


def test_an_empty_map_comes_back(tmp_path):
    save_metric_map(MetricMap(), tmp_path / "map.npz")
    assert not np.any(load_metric_map(tmp_path / "map.npz").bounds())


def test_the_same_map_is_the_same_file(explored, written, tmp_path):
    save_metric_map(explored, tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == written


@settings(max_examples=60)
@given(data=st.data())
def test_a_damaged_file_is_refused_or_harmless(written, tmp_path_factory, data):
    path = tmp_path_factory.mktemp("damaged") / "map.npz"
    content = bytearray(written)
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    path.write_bytes(bytes(content))
    try:
        metric_map = load_metric_map(path)
    except InputError as error:
        assert str(path) in str(error) and "\n" not in str(error)
    else:
        # A bit that no reader needs: a date in the archive's directory.
        lower, upper = metric_map.bounds()
        assert (metric_map.log_odds(lower, upper).shape == upper - lower).all()


def entries(**changes):
    good = {"format": "sarsim metric map", "version": 1, "lower": np.zeros(3, np.int64)}
    return good | {"log_odds": np.ones((2, 2, 2), np.int8)} | changes


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"depth": np.zeros(3)}, "not a metric map"),
        (entries(format="other"), "not a metric map"),
        (entries(version=2), "version"),
        (entries(log_odds=np.ones((2, 2), np.int8)), "log_odds"),
        (entries(log_odds=np.ones((2, 2, 2))), "log_odds"),
        (entries(lower=np.zeros(2, np.int64)), "lower"),
        (entries(colour="red"), "settings"),
        (entries(voxel_size=-1.0), "voxel_size"),
        (entries(voxel_size="wide"), "settings"),
        (entries(offset=1.0), "offset"),
        (entries(max_bytes=10.5), "max_bytes"),
    ],
)
def test_foreign_content_is_named(content, message, tmp_path):
    np.savez(tmp_path / "map.npz", **content)
    with pytest.raises(InputError, match=message):
        load_metric_map(tmp_path / "map.npz")


def test_a_pickle_is_not_run(tmp_path):
    np.savez(tmp_path / "map.npz", **entries(lower=np.array([print, 0, 0], object)))
    with pytest.raises(InputError, match=r"map\.npz"):
        load_metric_map(tmp_path / "map.npz")


def test_a_file_that_unpacks_to_more_than_a_map_may_have_is_refused(tmp_path):
    np.savez_compressed(tmp_path / "map.npz", **entries(log_odds=np.ones((64, 64, 64), np.int8), max_bytes=1000))
    with pytest.raises(InputError, match="bytes"):
        load_metric_map(tmp_path / "map.npz")


def test_a_missing_file_and_a_folder_that_is_not_there_are_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.npz"):
        load_metric_map(tmp_path / "nowhere.npz")
    with pytest.raises(InputError, match="nowhere"):
        save_metric_map(MetricMap(), tmp_path / "nowhere" / "map.npz")
