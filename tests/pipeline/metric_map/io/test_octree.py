"""The octree twin and its files, also as OctoMap itself reads and writes them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pipeline.errors import InputError
from pipeline.labels import COLOURS, Label
from pipeline.metric_map.io.octomap import read_octomap, write_bt, write_ot
from pipeline.metric_map.io.octree import DEPTH, Octree, decode, encode, voxel_labels
from pipeline.metric_map.metric_map import MetricMap, MetricMapConfig

pyoctomap = pytest.importorskip("pyoctomap")

values = hnp.arrays(np.int8, (8, 8, 8), elements=st.sampled_from([-9, -1, 0, 5, 40]), fill=st.just(-9))
places = st.tuples(*[st.integers(-20, 20)] * 3).map(np.array)


def filled(lower, log_odds):
    metric_map = MetricMap()
    metric_map.set_log_odds(lower, log_odds)
    return metric_map


def coloured(metric_map):
    labels = (np.arange(len(metric_map.occupied_centres())) % len(Label)).astype(np.uint8)
    return Octree.from_metric_map(metric_map, labels)


def same(first, second):
    corners = np.array([*first.bounds(), *second.bounds()])
    lower, upper = corners.min(axis=0), corners.max(axis=0)
    return np.array_equal(first.log_odds(lower, upper), second.log_odds(lower, upper))


@given(hnp.arrays(np.int64, (7, 3), elements=st.integers(-(1 << 15), (1 << 15) - 1)))
def test_codes_hold_the_index(index):
    np.testing.assert_array_equal(decode(encode(index)), index)


@given(places, values)
def test_the_twin_has_the_very_voxels_of_the_map(lower, log_odds):
    metric_map = filled(lower, log_odds)
    assert same(Octree.from_metric_map(metric_map).to_metric_map(), metric_map)


@pytest.mark.parametrize(("side", "level"), [(1, 0), (2, 1), (4, 2), (16, 4)])
def test_a_uniform_cube_is_one_leaf(side, level):
    octree = Octree.from_metric_map(filled(np.zeros(3, np.int64), np.full((side,) * 3, -5, np.int8)))
    assert octree.level.tolist() == [level]
    assert octree.sides.tolist() == [side * 0.1]
    np.testing.assert_allclose(octree.centres, [octree.corner + side * 0.05], atol=1e-6)


def test_a_leaf_ends_where_the_class_changes():
    metric_map = filled(np.zeros(3, np.int64), np.full((2, 2, 2), 40, np.int8))
    centres = metric_map.occupied_centres()
    labels = np.where(centres[:, 0] > 0.1, Label.WALL, Label.TERRAIN).astype(np.uint8)
    assert len(Octree.from_metric_map(metric_map, labels).level) == 8


def test_voxels_get_the_class_of_most_of_their_points_or_of_one_beside_them():
    metric_map = filled(np.zeros(3, np.int64), np.array([[[40, 40, 40, 40]]], np.int8))
    a, b, beside_b, _ = metric_map.occupied_centres()
    b[2] = (b[2] + beside_b[2]) / 2 - 0.01
    points = np.array([a, a, a, b, [9, 9, 9]], np.float32)
    labels = np.array([Label.WALL, Label.TERRAIN, Label.WALL, Label.VICTIM, Label.CLUTTER], np.uint8)
    expected = [Label.WALL, Label.VICTIM, Label.VICTIM, Label.UNLABELLED]
    assert voxel_labels(metric_map, points, labels).tolist() == expected
    assert voxel_labels(MetricMap(), points, labels).size == 0


def test_a_map_farther_than_the_octree_reaches_is_refused():
    with pytest.raises(InputError, match="reaches"):
        Octree.from_metric_map(filled(np.array([1 << 15, 0, 0]), np.ones((1, 1, 1), np.int8)))


@settings(max_examples=40)
@given(lower=places, log_odds=values)
def test_files_bring_the_tree_back(lower, log_odds, tmp_path_factory):
    folder = tmp_path_factory.mktemp("octomap")
    metric_map = filled(lower, log_odds)
    octree = coloured(metric_map)
    write_ot(folder / "map.ot", octree)
    again = read_octomap(folder / "map.ot")
    assert sorted(zip(again.code, again.level, again.log_odds, again.label, strict=True)) == sorted(
        zip(octree.code, octree.level, octree.log_odds, octree.label, strict=True)
    )
    assert again.voxel_size == octree.voxel_size and again.corner.tolist() == octree.corner.tolist()
    write_bt(folder / "map.bt", octree)
    binary = read_octomap(folder / "map.bt").to_metric_map()
    sure = np.where(log_odds > 0, 40, np.where(log_odds < 0, -9, 0)).astype(np.int8)
    assert same(binary, filled(lower, sure))


@settings(max_examples=25)
@given(lower=places, log_odds=values)
def test_octomap_reads_both_files_and_writes_the_very_same_data(lower, log_odds, tmp_path_factory):
    if not log_odds.any():
        return
    folder = tmp_path_factory.mktemp("octomap")
    metric_map = filled(lower, log_odds)
    octree = coloured(metric_map)
    write_bt(folder / "ours.bt", octree)
    write_ot(folder / "ours.ot", octree)
    binary, full = pyoctomap.OcTree(0.3), pyoctomap.ColorOcTree(0.3)
    assert binary.readBinary(str(folder / "ours.bt"))
    full = full.read(str(folder / "ours.ot"))
    binary.writeBinary(str(folder / "theirs.bt"))
    full.write(str(folder / "theirs.ot"))
    for name in ("bt", "ot"):
        ours, theirs = ((folder / f"{who}.{name}").read_bytes() for who in ("ours", "theirs"))
        assert ours.partition(b"data\n")[2] == theirs.partition(b"data\n")[2]
    for tree in (binary, full):
        for index, value in zip(np.ndindex(8, 8, 8), log_odds.ravel(), strict=True):
            node = tree.search(((lower + index + 0.5) * 0.1).tolist())
            known = node is not None and bool(node)
            assert known == (value != 0)
            assert not known or tree.isNodeOccupied(node) == (value > 0)


def test_a_tree_that_octomap_made_is_read(tmp_path):
    tree = pyoctomap.OcTree(0.1)
    points = np.random.default_rng(0).uniform(-1, 1, (300, 3)) + np.array([2, 0, 1])
    tree.insertPointCloud(points, np.array([0.0, 0, 0.5]))
    tree.write(str(tmp_path / "map.ot"))
    metric_map = read_octomap(tmp_path / "map.ot").to_metric_map(
        MetricMapConfig(greatest=100, least=-50, hit=60)
    )
    assert metric_map.corner.tolist() == [0, 0, 0]
    leaves = [
        (leaf.getCoordinate(), round(leaf.getSize() / 0.1), tree.isNodeOccupied(leaf))
        for leaf in tree.begin_leafs()
    ]
    assert {occupied for _, _, occupied in leaves} == {True, False}
    known = 0
    for centre, side, occupied in leaves:
        lower = np.rint(np.array(centre) / 0.1 - side / 2).astype(int)
        box = metric_map.log_odds(lower, lower + side)
        assert ((box > 0) == occupied).all() and box.all()
        known += box.size
    assert np.count_nonzero(metric_map.log_odds(*metric_map.bounds())) == known


def test_colours_are_those_of_the_classes(tmp_path):
    metric_map = filled(np.zeros(3, np.int64), np.full((1, 1, 1), 40, np.int8))
    octree = Octree.from_metric_map(metric_map, np.array([Label.INCLINED_RAMP], np.uint8))
    write_ot(tmp_path / "map.ot", octree)
    data = (tmp_path / "map.ot").read_bytes().partition(b"data\n")[2]
    assert len(data) == (DEPTH + 1) * 8
    assert data[-4:-1] == COLOURS[Label.INCLINED_RAMP].tobytes()


@settings(max_examples=60)
@given(data=st.data(), kind=st.sampled_from(["bt", "ot"]))
def test_a_truncated_file_is_refused_and_a_changed_one_at_most_another_map(data, kind, tmp_path_factory):
    folder = tmp_path_factory.mktemp("damaged")
    octree = coloured(filled(np.zeros(3, np.int64), np.full((3, 3, 3), 5, np.int8)))
    path = folder / f"map.{kind}"
    (write_bt if kind == "bt" else write_ot)(path, octree)
    content = bytearray(path.read_bytes())
    truncated = data.draw(st.booleans())
    if truncated:
        content = content[: data.draw(st.integers(0, len(content) - 1))]
        if content.endswith(b"\ndata\n"):
            return  # an empty tree
    else:
        content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    path.write_bytes(bytes(content))
    try:
        read_octomap(path).to_metric_map(MetricMapConfig(max_bytes=2**26))
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert not truncated


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not a file of OctoMap"),
        (b"PLY\n", "not a file of OctoMap"),
        (b"# Octomap OcTree file\nid CountingOcTree\nsize 1\nres 0.1\ndata\n\x00", "CountingOcTree"),
        (b"# Octomap OcTree binary file\nid OcTree\nsize 1\nres -1\ndata\n\x00\x00", "res"),
        (b"# Octomap OcTree binary file\nid OcTree\nsize 1\ndata\n\x00\x00", "res"),
        (b"# Octomap OcTree binary file\nid OcTree\nsize 1\nres 0.1\ndata\n\x00", "damaged"),
        (b"# Octomap OcTree file\nid OcTree\nsize 1\nres 0.1\ndata\n\x00\x00\xc0\x7f\x00", "damaged"),
    ],
)
def test_foreign_files_are_named(content, message, tmp_path):
    (tmp_path / "map.bt").write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_octomap(tmp_path / "map.bt")


def test_a_leaf_of_the_whole_world_does_not_fill_the_memory(tmp_path):
    content = b"# Octomap OcTree file\nid OcTree\nsize 1\nres 0.1\ndata\n\x00\x00\x80\x3f\x00"
    (tmp_path / "map.ot").write_bytes(content)
    with pytest.raises(InputError, match="bound"):
        read_octomap(tmp_path / "map.ot").to_metric_map()
