"""Saved maps, read back by Open3D."""

from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

from pipeline.errors import InputError
from pipeline.labels import COLOURS
from pipeline.semantic_map.ply import read_ply
from pipeline.semantic_map.semantic_map import SemanticMap


@pytest.fixture
def semantic_map() -> SemanticMap:
    rng = np.random.default_rng(0)
    semantic_map = SemanticMap()
    semantic_map.update(
        rng.uniform(-3, 3, (500, 3)).astype(np.float32), rng.dirichlet(np.ones(8), 500).astype(np.float32)
    )
    return semantic_map


def test_open3d_reads_points_colours_and_labels(semantic_map: SemanticMap, tmp_path: Path) -> None:
    path = tmp_path / "semantic_map.ply"
    semantic_map.save(path)
    cloud = o3d.t.io.read_point_cloud(str(path))
    assert np.array_equal(cloud.point.positions.numpy(), semantic_map.points())
    assert np.array_equal(cloud.point.label.numpy()[:, 0], semantic_map.labels())
    assert np.array_equal(cloud.point.scalar_label.numpy()[:, 0], semantic_map.labels())  # CloudCompare's name
    assert np.array_equal(cloud.point.colors.numpy(), COLOURS[semantic_map.labels()])


def test_empty_map_is_a_whole_file(tmp_path: Path) -> None:
    SemanticMap().save(tmp_path / "empty.ply")
    header = (tmp_path / "empty.ply").read_bytes()
    assert b"element vertex 0\n" in header
    assert header.endswith(b"end_header\n")


def test_folder_that_is_not_there_is_named(semantic_map: SemanticMap, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        semantic_map.save(tmp_path / "nowhere" / "semantic_map.ply")
    assert not list(tmp_path.iterdir())


def test_what_was_written_comes_back(semantic_map: SemanticMap, tmp_path: Path) -> None:
    path = tmp_path / "semantic_map.ply"
    semantic_map.save(path)
    vertices = read_ply(path)
    assert np.array_equal(np.stack([vertices[axis] for axis in "xyz"], axis=1), semantic_map.points())
    assert np.array_equal(vertices["label"], semantic_map.labels())


@pytest.mark.parametrize("count", [b"-5", b"2000000000", b"499", b"nan"])
def test_another_number_of_vertices_is_one_line(
    count: bytes, semantic_map: SemanticMap, tmp_path: Path, capfd
) -> None:
    path = tmp_path / "semantic_map.ply"
    semantic_map.save(path)
    path.write_bytes(path.read_bytes().replace(b"vertex 500", b"vertex " + count))
    with pytest.raises(InputError, match=r"semantic_map\.ply"):
        read_ply(path)
    assert not capfd.readouterr().err


def test_points_of_what_has_gone_are_left_out(semantic_map: SemanticMap, tmp_path: Path) -> None:
    semantic_map.save(tmp_path / "map.ply", lambda points: points[:, 0] > 0)
    vertices, points = read_ply(tmp_path / "map.ply"), semantic_map.points()
    np.testing.assert_array_equal(vertices["x"], points[points[:, 0] <= 0, 0])
    np.testing.assert_array_equal(vertices["label"], semantic_map.labels()[points[:, 0] <= 0])
