"""OctoMap's files, as OctoMap itself reads them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pipeline.errors import InputError
from pipeline.labels import COLOURS, Label
from pipeline.metric_map.io.octomap import voxel_labels, write_bt, write_ot
from pipeline.metric_map.metric_map import MetricMap
from tests.pipeline.metric_map.io.octomap_files import colours, log_odds, read_bt, read_ot

values = hnp.arrays(np.int8, (8, 8, 8), elements=st.sampled_from([-9, -1, 0, 5, 40]), fill=st.just(-9))
places = st.tuples(*[st.integers(-20, 20)] * 3).map(np.array)


def filled(lower, log_odds):
    metric_map = MetricMap()
    metric_map.set_log_odds(np.array(lower), log_odds)
    return metric_map


@settings(max_examples=25)
@given(lower=places, content=values)
def test_both_files_hold_the_map_voxel_for_voxel(lower, content, tmp_path_factory):
    folder = tmp_path_factory.mktemp("octomap")
    metric_map = filled(lower, content)
    labels = (np.arange(len(metric_map.occupied_centres())) % len(Label)).astype(np.uint8)
    write_bt(folder / "map.bt", metric_map)
    write_ot(folder / "map.ot", metric_map, labels)
    full = read_ot(folder / "map.ot")
    np.testing.assert_allclose(log_odds(full, lower - 1, (10,) * 3), np.pad(content, 1) * 0.1, rtol=1e-6)
    np.testing.assert_array_equal(colours(full, metric_map), COLOURS[labels])
    binary = np.sign(log_odds(read_bt(folder / "map.bt"), lower - 1, (10,) * 3))
    np.testing.assert_array_equal(binary, np.sign(np.pad(content, 1)))


def test_uniform_free_space_is_one_leaf(tmp_path):
    metric_map = filled((0, 0, 0), np.full((16, 16, 16), -5, np.int8))
    write_bt(tmp_path / "map.bt", metric_map)
    write_ot(tmp_path / "map.ot", metric_map)
    assert read_bt(tmp_path / "map.bt").getNumLeafNodes() == 1
    assert read_ot(tmp_path / "map.ot").getNumLeafNodes() == 1


def test_the_header_says_where_the_first_voxel_begins(tmp_path):
    metric_map = filled((0, 0, 0), np.ones((1, 1, 1), np.int8))
    for name, write in (("map.bt", write_bt), ("map.ot", write_ot)):
        write(tmp_path / name, metric_map)
        header = (tmp_path / name).read_bytes().partition(b"data\n")[0].decode().splitlines()
        (line,) = (line for line in header if line.startswith("# corner "))
        assert [float(word) for word in line.split()[2:]] == metric_map.corner.tolist()


def test_a_map_without_labels_is_grey(tmp_path):
    metric_map = filled((0, 0, 0), np.full((2, 1, 1), 40, np.int8))
    write_ot(tmp_path / "map.ot", metric_map)
    assert colours(read_ot(tmp_path / "map.ot"), metric_map).tolist() == [COLOURS[0].tolist()] * 2


def test_an_empty_map_is_an_empty_tree(tmp_path):
    write_bt(tmp_path / "map.bt", MetricMap())
    write_ot(tmp_path / "map.ot", MetricMap())
    assert read_bt(tmp_path / "map.bt").size() == 0
    assert read_ot(tmp_path / "map.ot").size() == 0


def test_what_cannot_be_written_is_refused(tmp_path):
    for write in (write_bt, write_ot):
        with pytest.raises(InputError, match="OctoMap"):
            write(tmp_path / "map", filled((2**15, 0, 0), np.ones((1, 1, 1), np.int8)))
        with pytest.raises(InputError, match="nowhere"):
            write(tmp_path / "nowhere" / "map", MetricMap())


def test_voxels_get_the_class_of_most_of_their_points_or_of_one_beside_them():
    metric_map = filled((0, 0, 0), np.array([[[40, 40, 40, 40]]], np.int8))
    a, b, beside_b, _ = metric_map.occupied_centres()
    b[2] = (b[2] + beside_b[2]) / 2 - 0.01
    points = np.array([a, a, a, b, [9, 9, 9]], np.float32)
    labels = np.array([Label.WALL, Label.TERRAIN, Label.WALL, Label.VICTIM, Label.CLUTTER], np.uint8)
    expected = [Label.WALL, Label.VICTIM, Label.VICTIM, Label.UNLABELLED]
    assert voxel_labels(metric_map, points, labels).tolist() == expected
    assert voxel_labels(MetricMap(), points, labels).size == 0
