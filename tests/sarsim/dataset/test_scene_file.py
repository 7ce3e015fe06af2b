"""A scene's file: round trip, its bytes, and files that are refused."""

import errno
import io
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis.extra.numpy import array_shapes, arrays

from pipeline.errors import InputError
from pipeline.files import atomic_write
from sarsim.dataset import hdf5
from sarsim.dataset.hdf5 import FAST_COMPRESSION
from sarsim.dataset.scene_file import Scene, SceneWriter
from tests.sarsim.dataset.small import content, frame, toys, write_scene


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "scene.h5"
    write_scene(path)
    return path


def test_what_was_written_is_read(file: Path) -> None:
    with Scene(file) as scene:
        assert len(scene) == len(list(scene)) == 3
        for index, read in enumerate(scene):
            scene_frame = frame(index)
            written = scene_frame.frame
            np.testing.assert_array_equal(read.rgb, written.rgb)
            np.testing.assert_allclose(read.depth, written.depth, atol=5.01e-4)
            assert ((read.depth == 0) == (written.depth == 0)).all()
            np.testing.assert_array_equal(read.label, written.label)
            np.testing.assert_array_equal(read.instance, written.instance)
            np.testing.assert_array_equal(read.T_base_camera, written.T_base_camera)
            np.testing.assert_array_equal(read.T_odom_base, written.T_odom_base)
            np.testing.assert_array_equal(scene.pose_true[index], scene_frame.pose_true)
            np.testing.assert_array_equal(scene.victim_pixels[index], scene_frame.victim_pixels)
            np.testing.assert_array_equal(scene.victim_area[index], scene_frame.victim_area)
            assert read.time == written.time
        assert scene.intrinsics == content().intrinsics
        assert scene.settings == content().settings


def test_what_surrounds_the_frames_is_read(file: Path) -> None:
    with Scene(file) as scene:
        read, written = scene.content, content()
    for name in ("mjcf", "geom_name", "victim_id", "settings", "intrinsics"):
        assert getattr(read, name) == getattr(written, name)
    for name in ("geom_label", "geom_victim", "victim_pose", "victim_box"):
        np.testing.assert_array_equal(getattr(read, name), getattr(written, name))


def test_a_scene_without_victims(tmp_path: Path) -> None:
    write_scene(tmp_path / "scene.h5", victims=0)
    with Scene(tmp_path / "scene.h5") as scene:
        assert scene.content.victim_id == []
        assert scene.victim_pixels.shape == (3, 0, 4)


def test_returns_are_counted_by_label(tmp_path: Path) -> None:
    with SceneWriter(tmp_path / "scene.h5", 2, content()) as writer:
        for index in range(2):
            writer.write(frame(index))
    frames = [frame(0).frame, frame(1).frame]
    for label in range(8):
        expected = sum(((f.label == label) & (f.depth > 0)).sum() for f in frames)
        assert writer.label_points[label] == expected


def test_the_same_frames_make_the_same_bytes(file: Path, tmp_path: Path) -> None:
    write_scene(tmp_path / "again.h5")
    assert (tmp_path / "again.h5").read_bytes() == file.read_bytes()


def test_an_image_is_a_chunk_that_any_hdf5_reads(file: Path) -> None:
    with h5py.File(file) as plain:
        for name in ("rgb", "depth", "label", "instance"):
            assert plain[name].chunks == (1, *plain[name].shape[1:])
            assert plain[name].compression == (None if name == "rgb" else "gzip")
        assert plain["depth"].dtype == np.uint16
        assert plain["mjcf"][:].tobytes().decode() == content().mjcf


@given(arrays(np.uint16, array_shapes(min_dims=2, max_dims=2, max_side=30)))
@example(np.random.default_rng(0).integers(800, 3500, (480, 640), np.uint16))
def test_any_hdf5_reads_noisy_images(image: np.ndarray) -> None:
    with h5py.File.in_memory() as file:
        filters = FAST_COMPRESSION | {"shuffle": True, "chunks": (1, *image.shape)}
        ours = file.create_dataset("ours", (2, *image.shape), np.uint16, **filters)
        hdf5.write_noisy(ours, 1, image)
        assert (ours[0] == 0).all()
        np.testing.assert_array_equal(ours[1], image)


def replaced(file: Path, name: str, **new: object) -> None:
    """Put something else in place of a part."""
    with h5py.File(file, "r+") as scene:
        del scene[name]
        scene.create_dataset(name, **new)


@pytest.mark.parametrize(
    ("name", "new", "message"),
    [
        ("depth", {"data": np.zeros((3, 6, 7), np.uint16)}, r"depth must have shape \(3, 6, 8\), not \(3, 6, 7\)"),
        ("pose_true", {"shape": (3, 4, 4), "dtype": "f4"}, "pose_true must have type float64, not float32"),
        (
            "pose_true",
            {"data": np.full((3, 4, 4), np.nan)},
            "pose_true contains a matrix that is not a rigid transform",
        ),
        (
            "T_base_camera",
            {"data": np.zeros((3, 4, 4))},
            "T_base_camera contains a matrix that is not a rigid transform",
        ),
        ("time", {"data": [0.0, 0.2, np.nan]}, "frame times must be finite and strictly increasing"),
        ("intrinsics", {"data": [0.0, 7, 4, 3]}, "intrinsics"),
        ("geoms/victim", {"data": np.array([-1, -1, 0, 7], "i2")}, "geoms/victim contains 7, .* of the 2 victims"),
        ("geoms/label", {"data": np.array([2, 1, 6, 99], "u1")}, "geoms/label contains 99; labels must be below 8"),
        ("geoms/name", {"data": np.array([b"\xff", b"", b"", b""])}, "can't decode"),
        ("victims/pixels", {"data": np.full((3, 2, 4), -5, "i4")}, "victims/pixels"),
        ("mjcf", {"shape": (2**50,), "dtype": "u1", "chunks": (2**20,)}, "mjcf "),
        ("mjcf", {"shape": (4,), "dtype": "u1", "external": [("/etc/hostname", 0, 4)]}, "mjcf "),
    ],
)
def test_numbers_of_a_stranger_that_make_no_sense(file: Path, name: str, new: dict, message: str) -> None:
    replaced(file, name, **new)
    with pytest.raises(InputError, match=f"damaged: .*{message}"):
        Scene(file)


def another_version(file: Path) -> None:
    with h5py.File(file, "r+") as scene:
        scene.attrs["version"] = 7


def missing_part(file: Path) -> None:
    with h5py.File(file, "r+") as scene:
        del scene["pose_true"]


def terabytes(file: Path) -> None:
    for name, pixel, kind in (("rgb", (3,), "u1"), ("depth", (), "u2"), ("label", (), "u1"), ("instance", (), "i2")):
        replaced(file, name, shape=(3, 10**6, 10**6, *pixel), dtype=kind, chunks=(1, 8, 8, *pixel))


def link_elsewhere(file: Path) -> None:
    write_scene(file.with_name("secret.h5"))
    with h5py.File(file, "r+") as scene:
        del scene["rgb"]
        scene["rgb"] = h5py.ExternalLink(file.with_name("secret.h5"), "/rgb")


def bomb(file: Path) -> None:
    with h5py.File(file, "r+") as scene:
        scene["label"].id.write_direct_chunk((1, 0, 0), zlib.compress(bytes(10_000_000), 9))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (Path.unlink, r"scene\.h5"),
        (lambda file: file.write_text("not HDF5"), r"scene\.h5"),
        (lambda file: file.write_bytes(file.read_bytes()[: file.stat().st_size // 2]), r"scene\.h5"),
        (another_version, "version 7"),
        (missing_part, r"scene\.h5: damaged"),
        (terabytes, "damaged: rgb"),
        (link_elsewhere, "rgb"),
        (bomb, "label has a chunk"),
    ],
)
def test_a_file_that_is_no_whole_scene_is_refused(file: Path, spoil: Callable[[Path], Any], message: str) -> None:
    spoil(file)
    with pytest.raises(InputError, match=message):
        list(Scene(file))


def test_a_file_without_objects_has_those_of_its_victims(file: Path) -> None:
    with h5py.File(file, "r+") as scene:
        del scene["geoms/object"]
    with Scene(file) as scene:
        np.testing.assert_array_equal(scene.content.object_of_geom, [*content().geom_object, -1])


def test_objects_that_are_no_geoms_are_refused(file: Path) -> None:
    with h5py.File(file, "r+") as scene:
        scene["geoms/object"][2] = 4
    with pytest.raises(InputError, match="geoms/object contains 4"):
        Scene(file)


@pytest.mark.parametrize(("name", "value"), [("label", 8), ("instance", 4), ("instance", -2)])
def test_pixels_of_labels_and_geoms_that_are_none(file: Path, name: str, value: int) -> None:
    with h5py.File(file, "r+") as scene:
        scene[name][1, 2, 3] = value
    with Scene(file) as scene:
        scene.frame(0)
        with pytest.raises(InputError, match=f"damaged: {name} of frame 1 has values from .* between .* and "):
            scene.frame(1)


def test_a_flipped_bit_in_an_image(file: Path) -> None:
    with h5py.File(file) as scene:
        info = scene["depth"].id.get_chunk_info(1)
    data = bytearray(file.read_bytes())
    data[info.byte_offset + info.size // 2] ^= 0x55
    file.write_bytes(data)
    with Scene(file) as scene:
        scene.frame(0)
        with pytest.raises(InputError, match="damaged: depth of frame 1"):
            scene.frame(1)


def test_a_file_of_which_hdf5_never_comes_back_is_refused_within_seconds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hdf5, "CHECK_SECONDS", 1)
    toys(tmp_path, 1)
    path = tmp_path / "scenes" / "00000.h5"
    data, rng = bytearray(path.read_bytes()), np.random.default_rng(11)
    end = 8192 if rng.random() < 0.7 else len(data)
    for place in rng.integers(end, size=rng.integers(1, 12)):
        data[place] = rng.integers(256)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"00000\.h5: .*HDF5"):
        Scene(path)


def test_a_full_disk_is_reported_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    limit = 5000

    class Limited(io.FileIO):
        def write(self, data):
            if self.tell() + len(data) > limit:
                raise OSError(errno.ENOSPC, "No space left on device")
            return super().write(data)

    class FullDisk(hdf5.CheckedFile, Limited):
        pass

    monkeypatch.setattr(hdf5, "CheckedFile", FullDisk)
    with (
        pytest.raises(InputError, match=r"scene\.h5: .*No space left on device"),
        atomic_write(tmp_path / "scene.h5") as partial,
    ):
        write_scene(partial)
    assert list(tmp_path.iterdir()) == []
