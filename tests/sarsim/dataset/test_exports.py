"""Exports, read back by Open3D, OpenCV and NumPy as their formats are published."""

import json
from dataclasses import asdict
from pathlib import Path

import cv2
import h5py
import numpy as np
import open3d as o3d
import pytest
import torch
import yaml
from evo.core.metrics import APE, PoseRelation, StatisticsType
from evo.tools.file_interface import read_tum_trajectory_file

from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.semantic_map.networks.dgcnn import Dgcnn
from sarsim.dataset.exports.export import Export
from sarsim.dataset.exports.images import Yolo
from sarsim.dataset.exports.points import CLASS_NAMES, Blocks, Cloud, S3dis
from sarsim.dataset.exports.tum import Tum
from sarsim.dataset.generate import generate
from sarsim.dataset.manifest import Dataset
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.scene_file import Scene
from tests.sarsim.dataset.small import InProcess

S3DIS_CLASSES = {
    *("ceiling", "floor", "wall", "beam", "column", "window", "door"),
    *("table", "chair", "sofa", "bookcase", "board", "clutter"),
}
"""All classes that have a colour in indoor3d_util.py, which refuses others."""
RECIPE = Recipe(seed=7, frames=6, width=96, height=72, arenas=("nist_6x4",), ideal=1, clear=0, dust=(0.2, 0.2))


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data") / "data"
    generate(RECIPE, 2, folder, InProcess())
    return folder


@pytest.fixture(scope="module")
def scene(data: Path) -> Scene:
    return Scene(data / Dataset(data).entries[1].file)


def exported(export: Export) -> Path:
    """Run an export; returns its folder."""
    assert [entry.index for entry in export.run()] == [0, 1]
    return export.out


@pytest.fixture(scope="module")
def folders(data: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """An export of each kind, which tests only read."""
    out = tmp_path_factory.mktemp("exports")
    blocks = Blocks(data, out / "blocks", points=256, min_points=20)
    exports = S3dis(data, out / "s3dis", voxel=0.02), blocks, Tum(data, out / "tum"), Yolo(data, out / "yolo", 30)
    return {export.out.name: exported(export) for export in exports}


def sorted_rows(rows: np.ndarray) -> np.ndarray:
    return rows[np.lexsort(rows.T)]


def test_s3dis_rooms_are_the_sum_of_their_annotations(folders: dict[str, Path], scene: Scene) -> None:
    room = folders["s3dis"] / "Area_1" / "arena_1"
    whole = np.loadtxt(room / "arena_1.txt")
    parts = {path.stem: np.loadtxt(path, ndmin=2) for path in (room / "Annotations").iterdir()}
    np.testing.assert_array_equal(sorted_rows(whole), sorted_rows(np.concatenate(list(parts.values()))))
    cloud = Cloud.of_scene(scene, 0.02)
    alone = len(cloud.points) - len(whole)
    assert 0 <= alone < 10  # objects with a single point
    for label in Label:
        mine = [part for name, part in parts.items() if name.rsplit("_", 1)[0] == CLASS_NAMES[label]]
        assert 0 <= (cloud.label == label).sum() - sum(map(len, mine)) <= alone
    assert {"wall_1", "wall_2", "floor_1", "window_1"} <= set(parts)  # specks of dust are unlabelled
    seen = scene.content.geom_victim[np.unique(np.concatenate([f.instance[f.returns] for f in scene]))[1:]]
    victims = [part[:, :3] for name, part in parts.items() if name.startswith("chair_")]
    assert len(victims) == len(set(seen[seen >= 0].tolist())) > 0
    assert all(np.ptp(points, axis=0).max() < 2.2 for points in victims)


def test_s3dis_is_what_its_published_reader_reads(folders: dict[str, Path]) -> None:
    """By the rules of collect_indoor3d_data.py and indoor3d_util.py of pointnet and dgcnn.pytorch."""
    folder = folders["s3dis"]
    classes, rooms, names_of_tables = (
        (folder / "meta" / f"{name}.txt").read_text().splitlines()
        for name in ("class_names", "anno_paths", "all_data_label")
    )
    assert set(classes) == S3DIS_CLASSES and len(classes) == len(S3DIS_CLASSES)
    assert names_of_tables == [f"{'_'.join(path.split('/')[:2])}.npy" for path in rooms]
    files = sorted((folder / rooms[1]).glob("*.txt"))
    assert {path.name.split("_")[0] for path in files} <= S3DIS_CLASSES  # whatever else would be clutter
    assert {np.loadtxt(path).shape[1:] for path in files} == {(6,)}


def test_s3dis_is_what_open3d_reads(folders: dict[str, Path]) -> None:
    room = folders["s3dis"] / "Area_1" / "arena_0"
    cloud = o3d.io.read_point_cloud(str(room / "arena_0.txt"), format="xyzrgb")
    rows = np.loadtxt(room / "arena_0.txt")
    np.testing.assert_allclose(np.asarray(cloud.points), rows[:, :3])
    np.testing.assert_allclose(np.asarray(cloud.colors), rows[:, 3:])


def test_thinning_leaves_one_point_in_each_cube(scene: Scene) -> None:
    cloud = Cloud.of_frame(scene, 0)
    thin = cloud.thinned(0.1)
    cubes = {tuple(cube) for cube in np.floor(cloud.points.astype(np.float64) / 0.1).astype(int).tolist()}
    kept = [tuple(cube) for cube in np.floor(thin.points.astype(np.float64) / 0.1).astype(int).tolist()]
    assert len(kept) == len(set(kept)) and set(kept) == cubes


def test_blocks_are_columns_of_labelled_points(folders: dict[str, Path], scene: Scene) -> None:
    folder = folders["blocks"]
    names = (folder / "all_files.txt").read_text().split()
    rooms = (folder / "room_filelist.txt").read_text().split()
    assert names == ["blocks/ply_data_all_0.h5", "blocks/ply_data_all_1.h5"]
    counts = []
    for name in names:
        with h5py.File(folder.parent / name) as file:
            data_, label = file["data"][:], file["label"][:]
        assert data_.shape[1:] == (256, 6) and data_.dtype == np.float32
        assert label.shape == data_.shape[:2] and label.dtype == np.uint8
        assert np.abs(data_[..., :2]).max() <= 0.5 + 1e-6
        assert data_[..., 2:].min() >= 0 and data_[..., 3:].max() <= 1
        counts.append(len(data_))
    assert sum(counts) == len(rooms)
    assert rooms[0].startswith("Area_1_arena_0_frame_0")
    first = sum(room == "Area_1_arena_1_frame_0" for room in rooms)
    cloud = Cloud.of_frame(scene, 0)
    assert_points_of(cloud, data_[:first], label[:first])


def test_coloured_blocks_fit_a_published_network(data: Path, tmp_path: Path, scene: Scene) -> None:
    """DGCNN_semseg_s3dis: nine channels, the colours in the middle, and 13 outputs."""
    folder = exported(Blocks(data, tmp_path / "blocks", points=64, min_points=20, colours=True))
    with h5py.File(folder / "ply_data_all_1.h5") as file:
        points, labels = torch.from_numpy(file["data"][:]), torch.from_numpy(file["label"][:].astype(np.int64))
    assert points.shape[1:] == (64, 9)
    cloud = Cloud.of_frame(scene, 0)
    seen = {tuple(row) for row in np.column_stack([cloud.rgb, cloud.label]).tolist()}
    assert {tuple(row) for row in torch.column_stack([255 * points[0, :, 3:6], labels[0]]).int().tolist()} <= seen
    logits = Dgcnn(channels=9, classes=len(S3DIS_CLASSES))(points[:2].flatten(0, 1), [64, 64])
    assert torch.nn.functional.cross_entropy(logits, labels[:2].flatten()).isfinite()


def test_blocks_are_what_published_loaders_read(data: Path, tmp_path: Path) -> None:
    """As load_data_semseg of antao97/dgcnn.pytorch, whose folder of data holds the export."""
    exported(Blocks(data, tmp_path / "indoor3d_sem_seg_hdf5_data", points=256, min_points=20))
    folder = tmp_path / "indoor3d_sem_seg_hdf5_data"
    all_files = [line.rstrip() for line in (folder / "all_files.txt").open()]
    room_filelist = [line.rstrip() for line in (folder / "room_filelist.txt").open()]
    batches = [h5py.File(tmp_path / file, "r+") for file in all_files]
    points = np.concatenate([file["data"][:] for file in batches])
    labels = np.concatenate([file["label"][:] for file in batches])
    train = [i for i, room_name in enumerate(room_filelist) if "Area_5" not in room_name]
    assert len(points[train]) == len(labels[train]) == len(room_filelist) > 0
    names = (folder / "meta" / "class_names.txt").read_text().split()
    assert names[Label.STRAIGHT_RAMP] == "straight_ramp" and len(names) > labels.max()


@pytest.mark.parametrize("kind", ["s3dis", "blocks", "tum", "yolo"])
def test_every_export_says_what_it_is(kind: str, folders: dict[str, Path], scene: Scene) -> None:
    folder = folders[kind]
    text = (folder / "README.md").read_text()
    assert "2 scenes" in text and "Apache-2.0" in text and "sarsim" in text
    card = yaml.safe_load(text.split("---")[1])
    assert (card["license"], card["pretty_name"], card["size_categories"]) == ("apache-2.0", kind, ["n<1K"])
    assert (folder / "labels.csv").read_text().splitlines()[5].startswith("4,straight_ramp,")
    assert json.loads((folder / "intrinsics.json").read_text())["arena_1"] == asdict(scene.intrinsics)
    assert "SPDX-License-Identifier: Apache-2.0" in (folder / "LICENSE").read_text()


def assert_points_of(cloud: Cloud, blocks: np.ndarray, labels: np.ndarray) -> None:
    """Every point of the blocks is one of the cloud's, with its label."""
    xyz = cloud.points - cloud.points.min(axis=0)
    known = {tuple(p) for p in np.column_stack([np.rint(xyz * 1000), cloud.label]).astype(int).tolist()}
    near = blocks[..., 3:] * xyz.max(axis=0)
    rows = np.column_stack([np.rint(near.reshape(-1, 3) * 1000), labels.ravel()]).astype(int).tolist()
    assert len(rows) > 500
    assert np.mean([tuple(row) in known for row in rows]) > 0.98  # the others are rounded to the next millimetre


def test_blocks_that_are_full_repeat_no_point_and_others_repeat_some() -> None:
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.uniform(0, 1, (300, 3)), rng.uniform((1.5, 0, 0), (2, 1, 1), (50, 3))])
    cloud = Cloud(
        points.astype(np.float32),
        np.zeros((350, 3), np.uint8),
        np.arange(350).astype(np.uint8),
        np.zeros(350, np.int32),
    )
    full, sparse = Blocks(Path(), Path(), points=200, min_points=20).of_cloud(cloud, rng)
    assert len(np.unique(full[0], axis=0)) == 200
    assert len(np.unique(sparse[0], axis=0)) <= 50 and len(sparse[0]) == 200
    assert len(list(Blocks(Path(), Path(), points=200, min_points=100).of_cloud(cloud, rng))) == 1


def test_a_look_without_returns_has_no_blocks() -> None:
    empty = Cloud(
        np.empty((0, 3), np.float32), np.empty((0, 3), np.uint8), np.empty(0, np.uint8), np.empty(0, np.int32)
    )
    assert list(Blocks(Path(), Path()).of_cloud(empty, np.random.default_rng(0))) == []


def test_tum_sequences_are_what_open3d_reads(folders: dict[str, Path], scene: Scene) -> None:
    sequence = folders["tum"] / "arena_1"
    fx, fy, cx, cy = np.loadtxt(sequence / "calibration.txt")
    camera = o3d.camera.PinholeCameraIntrinsic(96, 72, fx, fy, cx, cy)
    truth = np.loadtxt(sequence / "groundtruth.txt")
    listed = [
        [line.split() for line in (sequence / f"{kind}.txt").read_text().splitlines() if line[0] != "#"]
        for kind in ("rgb", "depth")
    ]
    assert len(truth) == len(listed[0]) == len(listed[1]) == len(scene)
    for index in (0, 3):
        (stamp, rgb), (again, depth) = listed[0][index], listed[1][index]
        assert float(stamp) == float(again) == truth[index, 0] == pytest.approx(scene.time[index])
        colour, ranges = (o3d.io.read_image(str(sequence / name)) for name in (rgb, depth))
        np.testing.assert_array_equal(np.asarray(colour), scene.frame(index).rgb)
        image = o3d.geometry.RGBDImage.create_from_tum_format(colour, ranges, convert_rgb_to_intensity=False)
        cloud = o3d.geometry.PointCloud.create_from_rgbd_image(image, camera)
        cloud.transform(pose(truth[index]))
        frame = scene.frame(index)
        near = frame.depth[frame.returns] < 4  # m; Open3D leaves out the rest
        expected = frame.points(scene.T_world_camera(index))[near]
        np.testing.assert_allclose(np.asarray(cloud.points), expected, atol=1e-3)


def test_tum_sequences_have_labels_and_odometry_for_evo(folders: dict[str, Path], scene: Scene) -> None:
    sequence = folders["tum"] / "arena_1"
    lines = [line.split() for line in (sequence / "label.txt").read_text().splitlines() if line[0] != "#"]
    for index, (_, name) in enumerate(lines):
        np.testing.assert_array_equal(cv2.imread(str(sequence / name), cv2.IMREAD_UNCHANGED), scene.label(index))
    names = ("groundtruth.txt", "odometry.txt")
    true, odometry = (read_tum_trajectory_file(str(sequence / name)) for name in names)
    error = APE(PoseRelation.translation_part)
    error.process_data((true, odometry))
    poses = scene.pose_odom @ scene.T_base_camera, scene.pose_true @ scene.T_base_camera
    off = np.linalg.norm(poses[0][:, :3, 3] - poses[1][:, :3, 3], axis=1)
    assert len(error.error) == len(scene)
    assert error.get_statistic(StatisticsType.max) == pytest.approx(off.max(), abs=1e-4)


def pose(row: np.ndarray) -> np.ndarray:
    """4×4 from t x y z qx qy qz qw, by Open3D's own means."""
    T = np.eye(4)
    x, y, z, w = row[4:]
    T[:3, :3] = o3d.geometry.get_rotation_matrix_from_quaternion([w, x, y, z])
    T[:3, 3] = row[1:4]
    return T


def test_yolo_boxes_are_those_of_the_victims(folders: dict[str, Path], scene: Scene) -> None:
    folder, met = folders["yolo"], 0
    for index, frame in enumerate(scene):
        name, split = f"00001_{index:05d}", "val" if index >= 5 else "train"
        image = cv2.imread(str(folder / "images" / split / f"{name}.jpg"))
        assert image.shape == frame.rgb.shape
        assert np.abs(image[..., ::-1].astype(int) - frame.rgb).mean() < 6
        text = (folder / "labels" / split / f"{name}.txt").read_text()
        boxes = np.array([line.split() for line in text.splitlines()], np.float64).reshape(-1, 5)
        assert (boxes[:, 0] == 0).all()
        middle, size = boxes[:, 1:3] * [96, 72], boxes[:, 3:] * [96, 72]
        expected = scene.victim_pixels[index][scene.victim_area[index] >= 30]
        np.testing.assert_allclose(np.hstack([middle - size / 2, middle + size / 2]), expected, atol=1e-3)
        met += len(boxes)
    assert met


def test_yolo_without_a_scene_to_validate_with_splits_by_frames(
    data: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = exported(Yolo(data, tmp_path / "yolo"))
    assert "the val split has no scenes" in caplog.text
    about = yaml.safe_load((folder / "data.yaml").read_text())
    # Rules of ultralytics' check_det_dataset: train, val and names; paths from the file's own folder.
    assert {"train", "val", "names"} <= set(about) and about["names"] == {0: "victim"}
    for split, count in (("train", 10), ("val", 2)):
        images = sorted((folder / about[split]).glob("*.jpg"))
        assert len(images) == count
        assert all(Path(str(path).replace("/images/", "/labels/")).with_suffix(".txt").is_file() for path in images)


def test_an_export_is_whole_or_not_there(data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(self, folder, entry, scene):
        (folder / "half").touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Tum, "add", fail)
    with pytest.raises(InputError, match=r"tum: .*No space left on device"):
        list(Tum(data, tmp_path / "tum").run())
    assert list(tmp_path.iterdir()) == []


def test_other_folders_are_left_alone(data: Path, tmp_path: Path) -> None:
    (tmp_path / "tum.part").mkdir()
    (tmp_path / "tum.part" / "thesis.txt").touch()
    exported(Tum(data, tmp_path / "tum"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["tum", "tum.part"]
    assert [path.name for path in (tmp_path / "tum.part").iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("exists", [False, True])
def test_of_two_exports_to_one_folder_the_first_is_kept_whole(exists: bool, data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    if exists:
        out.mkdir()
    first, second = Tum(data, out).run(), Yolo(data, out).run()
    next(first), next(second)
    list(first)
    before = {path.name for path in out.iterdir() if path.suffix != ".part"}
    assert {"arena_0", "arena_1", "README.md"} <= before
    with pytest.raises(InputError, match="out: "):
        list(second)
    assert {path.name for path in out.iterdir()} == before and list(tmp_path.iterdir()) == [out]


def test_the_current_folder_is_filled_not_replaced(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "blocks"
    out.mkdir()
    monkeypatch.chdir(out)
    exported(Blocks(data, Path(), points=64, min_points=20))
    assert Path.cwd().samefile(out) and list(tmp_path.iterdir()) == [out]
    assert 'pretty_name: "blocks"' in Path("README.md").read_text()
    assert set(Path("all_files.txt").read_text().split()) == {f"blocks/ply_data_all_{n}.h5" for n in (0, 1)}


@pytest.mark.parametrize(
    ("export", "flag", "value", "limits"),
    [
        (S3dis, "voxel", 0, "at least 0.001"),
        (S3dis, "voxel", float("nan"), "at least 0.001"),
        (Blocks, "points", 0, "at least 1"),
        (Blocks, "min_points", 0, "at least 1"),
        (Yolo, "min_area", -5, "at least 1"),
    ],
)
def test_settings_that_make_no_export(export: type[Export], flag: str, value: float, limits: str) -> None:
    with pytest.raises(InputError, match=f"--{flag.replace('_', '-')} {value:g}: "):
        export(Path(), Path(), **{flag: value})


def test_nothing_is_overwritten(data: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").touch()
    with pytest.raises(InputError, match=r"thesis\.txt"):
        list(Tum(data, tmp_path).run())


def test_a_missing_scene_or_dataset_is_reported(data: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a dataset"):
        list(Tum(tmp_path, tmp_path / "tum").run())
    (tmp_path / "dataset.json").write_bytes((data / "dataset.json").read_bytes())
    with pytest.raises(InputError, match=r"scenes/00000\.h5"):
        list(Tum(tmp_path, tmp_path / "tum").run())
    assert not (tmp_path / "tum").exists()
