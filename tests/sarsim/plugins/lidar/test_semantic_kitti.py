"""SemanticKITTI's layout, read as public code reads it: NumPy's fromfile and PyYAML, no code of ours."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal

from pipeline.errors import InputError
from pipeline.labels import COLOURS, Label
from sarsim.plugins.lidar.config import LidarConfig
from sarsim.plugins.lidar.scanner import Scan
from sarsim.plugins.lidar.semantic_kitti import SequenceWriter, sequence_folder, write_label_table
from tests.sarsim.plugins.lidar.hall import Hall


def written(folder: Path, seed: int = 0) -> list[Scan]:
    """Two scans of a robot that moves, as sequence 3."""
    hall, writer = Hall(), SequenceWriter(sequence_folder(folder, 3))
    scanner, scans = hall.scanner(LidarConfig("8x90").model(), seed), []
    for k in range(2):
        hall.move(0.5 * k, 0.1, 0.3 * k)
        scans.append(scanner.scan(0.1 * k))
        writer.add(scans[-1])
    writer.save()
    write_label_table(folder, {3: "val", 4: "train"})
    return scans


def calibration(path: Path) -> dict[str, np.ndarray]:
    """As semantic-kitti-api's parse_calibration reads it."""
    calib = {}
    for line in path.read_text().splitlines():
        key, content = line.strip().split(":")
        pose = np.zeros((4, 4))
        pose[:3] = np.array([float(value) for value in content.strip().split()]).reshape(3, 4)
        pose[3, 3] = 1
        calib[key] = pose
    return calib


def poses(path: Path, calib: dict[str, np.ndarray]) -> list[np.ndarray]:
    """As semantic-kitti-api's parse_poses reads them: poses of the left camera, turned into the lidar's."""
    Tr, found = calib["Tr"], []
    for line in path.read_text().splitlines():
        pose = np.zeros((4, 4))
        pose[:3] = np.array([float(value) for value in line.strip().split()]).reshape(3, 4)
        pose[3, 3] = 1
        found.append(np.linalg.inv(Tr) @ pose @ Tr)
    return found


def test_a_public_loader_reads_what_was_scanned(tmp_path):
    scans = written(tmp_path)
    config = yaml.safe_load((tmp_path / "lidar" / "labels.yaml").read_text())
    folder = tmp_path / "lidar" / "sequences" / "03"
    files = [sorted((folder / kind).iterdir()) for kind in ("velodyne", "labels")]
    assert [[path.name for path in kind] for kind in files] == [
        ["000000.bin", "000001.bin"],
        ["000000.label", "000001.label"],
    ]
    remap = np.zeros(max(config["learning_map"]) + 1, np.int32)
    remap[list(config["learning_map"])] = list(config["learning_map"].values())
    for scan, cloud, labels in zip(scans, *files, strict=True):
        points = np.fromfile(cloud, dtype=np.float32).reshape((-1, 4))
        ids = np.fromfile(labels, dtype=np.uint32)
        semantic, instance = ids & 0xFFFF, ids >> 16
        assert_array_equal(points[:, :3], scan.points)
        assert_allclose(points[:, 3], scan.intensity)
        assert_array_equal(remap[semantic], scan.label)
        assert_array_equal(instance.astype(int) - 1, scan.instance)
        assert {config["labels"][label] for label in semantic.tolist()} >= {"wall", "terrain", "clutter"}
    found = poses(folder / "poses.txt", calibration(folder / "calib.txt"))
    assert_allclose(found, [scan.T_world_lidar for scan in scans], atol=1e-7)
    assert_allclose(np.loadtxt(folder / "times.txt"), [0, 0.1])
    tum = np.loadtxt(folder / "trajectory_true.tum")
    assert_allclose(tum[:, 0], [0, 0.1])
    assert_allclose(tum[:, 1:4], [pose[:3, 3] for pose in found], atol=1e-6)


def test_the_table_has_every_label_and_split(tmp_path):
    written(tmp_path)
    config = yaml.safe_load((tmp_path / "lidar" / "labels.yaml").read_text())
    assert config["labels"] == {int(label): label.name.lower() for label in Label}
    assert config["color_map"][int(Label.WALL)] == COLOURS[Label.WALL].tolist()[::-1]
    assert config["split"] == {"train": [4], "valid": [3], "test": []}
    assert [label for label, ignored in config["learning_ignore"].items() if ignored] == [0]


def test_the_same_seed_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        written(tmp_path / name)
    for path in (tmp_path / "a").rglob("*"):
        if path.is_file():
            assert path.read_bytes() == (tmp_path / "b" / path.relative_to(tmp_path / "a")).read_bytes()


def test_a_sequence_that_is_written_again_has_nothing_of_the_former_one(tmp_path):
    for count in (3, 1):
        writer = SequenceWriter(tmp_path / "00")
        for _ in range(count):
            writer.add(Hall().scanner().scan(0.0))
        writer.save()
    assert len(list((tmp_path / "00" / "velodyne").iterdir())) == 1
    assert len((tmp_path / "00" / "poses.txt").read_text().splitlines()) == 1


def test_a_folder_that_cannot_be_written_is_a_line(tmp_path):
    (tmp_path / "lidar").write_text("a file")
    with pytest.raises(InputError, match="cannot be written"):
        SequenceWriter(sequence_folder(tmp_path, 0))
