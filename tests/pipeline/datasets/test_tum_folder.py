"""TUM folders: what is read of them, and what is wrong with them."""

import os
import resource
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.datasets.tum_folder import read_tum_folder
from pipeline.errors import InputError
from pipeline.frame import Calibration
from pipeline.localisation.config import TrajectoryConfig
from tests.pipeline.datasets.recorded_room import ODOMETRY, WAY, camera_poses, frames, write_tum_folder

NUMBER = 6
"""Frames of the drive."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    true, believed = (camera_poses(poses[:NUMBER]) for poses in (WAY, ODOMETRY))
    return write_tum_folder(tmp_path / "room", NUMBER, groundtruth=true, odometry=believed)


def test_frames_come_back(folder: Path) -> None:
    recording = read_tum_folder(folder)
    for frame, true in zip(recording.frames(), frames()[:NUMBER], strict=True):
        assert frame.time == true.time
        assert frame.intrinsics == true.intrinsics
        np.testing.assert_allclose(frame.depth, true.depth, atol=1.1e-4)
        np.testing.assert_array_equal(frame.rgb, true.rgb)


def test_trajectories_come_back(folder: Path) -> None:
    recording = read_tum_folder(folder)
    assert recording.truth is not None and recording.odometry is not None
    np.testing.assert_allclose(recording.truth.poses, camera_poses(WAY[:NUMBER]), atol=1e-12)
    base = recording.truth.of_base(frames()[0].T_base_camera)
    np.testing.assert_allclose(base.poses[:, 2, 3], 0, atol=1e-12)
    odometry = recording.odometry.of_base(frames()[0].T_base_camera)
    np.testing.assert_allclose(odometry.at(0.45, TrajectoryConfig()), 0.5 * (ODOMETRY[4] + ODOMETRY[5]), atol=1e-3)
    assert odometry.at(-1.0, TrajectoryConfig()) is None


@pytest.mark.parametrize(
    ("felt", "up"),
    [((0.5, 9, 3), (0.5, -9, -3)), ((0.5, -9, 3), (0.5, -9, 3)), ((0, 0, 0), None)],
    ids=["Kinect", "camera", "nothing"],
)
def test_an_accelerometer_measures_the_vertical(folder: Path, felt: tuple, up: tuple | None) -> None:
    rows = [f"{time:.2f} {' '.join(map(str, felt))}" for time in (0.0, 0.2, 0.4)]
    (folder / "accelerometer.txt").write_text("\n".join(["# timestamp ax ay az", *rows, "9 7 7 7"]) + "\n")
    found = read_tum_folder(folder).up
    if up is None:
        assert found is None
    else:
        np.testing.assert_allclose(found, np.array(up) / np.linalg.norm(up))


def test_numbered_images_take_their_times_from_the_rate(folder: Path) -> None:
    for name in ("rgb", "depth"):
        (folder / f"{name}.txt").unlink()
    (folder / "rgb").rename(folder / "color")
    with pytest.raises(InputError, match=r"depth: .*--fps"):
        read_tum_folder(folder)
    times = [frame.time for frame in read_tum_folder(folder, fps=10.0).frames()]
    np.testing.assert_allclose(times, [frame.time for frame in frames()[:NUMBER]])


def test_a_depth_scale_and_intrinsics_can_be_given(folder: Path) -> None:
    (folder / "calibration.txt").unlink()
    with pytest.raises(InputError, match=r"calibration.txt.*--intrinsics"):
        read_tum_folder(folder)
    frame = next(read_tum_folder(folder, Calibration(1, 2, 3, 4), depth_scale=2500).frames())
    assert (frame.intrinsics.fx, frame.intrinsics.cy) == (1, 4.5)
    np.testing.assert_allclose(frame.depth, 2 * frames()[0].depth, atol=3e-4)


def test_float_images_are_in_metres(folder: Path) -> None:
    for file, frame in zip(sorted((folder / "depth").glob("*.png")), frames()[:NUMBER], strict=True):
        cv2.imwrite(str(file.with_suffix(".tiff")), frame.depth)
    listed = (folder / "depth.txt").read_text()
    (folder / "depth.txt").write_text(listed.replace(".png", ".tiff"))
    for frame, true in zip(read_tum_folder(folder).frames(), frames(), strict=False):
        np.testing.assert_array_equal(frame.depth, true.depth)


def test_the_largest_number_is_no_return(folder: Path) -> None:
    (folder / "depth" / "0.000.png").write_bytes(cv2.imencode(".png", np.full((240, 320), 65535, np.uint16))[1])
    assert not next(read_tum_folder(folder).frames()).depth.any()


def test_depth_without_colour_is_left_out(folder: Path) -> None:
    lines = (folder / "rgb.txt").read_text().splitlines()
    (folder / "rgb.txt").write_text("\n".join(lines[:-2]))
    recording = read_tum_folder(folder)
    assert len(list(recording.frames())) == NUMBER - 2
    assert recording.left_out == {"depth images without a colour image": 2}


@pytest.mark.parametrize("kind", ["depth", "rgb"])
def test_a_listed_image_that_is_missing_costs_its_frame(kind: str, folder: Path) -> None:
    (folder / kind / "0.300.png").unlink()
    recording = read_tum_folder(folder)
    assert len(list(recording.frames())) == NUMBER - 1
    assert [count for reason, count in recording.left_out.items() if "missing" in reason] == [1]
    (note,) = recording.notes
    assert f"1 of {2 * NUMBER} " in note and f"{kind}/0.300.png" in note


def test_if_all_images_are_missing_the_first_is_named(folder: Path) -> None:
    (folder / "depth").rename(folder / "Depth")
    with pytest.raises(InputError, match=r"6 of 12 .*depth/0.000.png"):
        read_tum_folder(folder)


def test_poses_that_are_not_read_are_said(folder: Path) -> None:
    (folder / "odometry.txt").rename(folder / "pose.txt")
    (note,) = read_tum_folder(folder).notes
    assert "pose.txt" in note and "odometry.txt" in note


@pytest.mark.parametrize("of_images", [1, 1000])
@pytest.mark.parametrize("of_poses", [1, 1000])
def test_poses_take_the_unit_of_time_that_fits_the_images(folder: Path, of_images: int, of_poses: int) -> None:
    for name, unit in (("rgb", of_images), ("depth", of_images), ("groundtruth", of_poses), ("odometry", of_poses)):
        rows = [line.split() for line in (folder / f"{name}.txt").read_text().splitlines()[1:]]
        lines = [" ".join([str(round(float(time) * unit, 3)), *rest]) for time, *rest in rows]
        (folder / f"{name}.txt").write_text("\n".join(lines))
    recording = read_tum_folder(folder)
    assert [frame.time for frame in recording.frames()] == [frame.time for frame in frames()[:NUMBER]]
    for poses in (recording.truth, recording.odometry):
        assert poses is not None
        np.testing.assert_allclose(poses.times, [frame.time for frame in frames()[:NUMBER]])


@pytest.mark.parametrize("lost", ["{} nan nan nan nan nan nan nan", "{} 0 0 0 0 0 0 0", "{} inf 0 0 0 0 0 1"])
def test_lines_without_a_pose_are_left_out_and_said(folder: Path, lost: str) -> None:
    lines = (folder / "groundtruth.txt").read_text().splitlines()
    lines[3], lines[5] = (lost.format(lines[k].split()[0]) for k in (3, 5))
    (folder / "groundtruth.txt").write_text("\n".join(lines))
    recording = read_tum_folder(folder)
    assert recording.truth is not None
    kept = [WAY[k] for k in range(NUMBER) if k not in (2, 4)]
    np.testing.assert_allclose(recording.truth.poses, camera_poses(kept), atol=1e-12)
    (note,) = recording.notes
    assert "groundtruth.txt: ignoring 2 of " in note


def test_what_was_not_felt_is_left_out_and_said(folder: Path) -> None:
    (folder / "accelerometer.txt").write_text("0 nan nan nan\n0.1 0 -9.81 0\n0.2 0 inf 0\n")
    recording = read_tum_folder(folder)
    np.testing.assert_allclose(recording.up, [0, -1, 0])
    (note,) = recording.notes
    assert "accelerometer.txt: ignoring 2 of 3 " in note


def test_each_list_may_have_its_own_unit_of_time(folder: Path) -> None:
    since = 1403636579
    for name, unit in (("rgb", 10**9), ("depth", 10**6), ("groundtruth", 1), ("odometry", 10**3)):
        lines = [line.split() for line in (folder / f"{name}.txt").read_text().splitlines()[1:]]
        stamps = [round((since + float(time)) * unit, 3) for time, *_ in lines]
        words = [str(stamp if unit == 1 else int(stamp)) for stamp in stamps]
        rows = [" ".join([word, *rest]) for word, (_, *rest) in zip(words, lines, strict=True)]
        (folder / f"{name}.txt").write_text("\n".join(rows))
    recording = read_tum_folder(folder)
    times = [frame.time for frame in recording.frames()]
    np.testing.assert_allclose(times, [since + frame.time for frame in frames()[:NUMBER]], atol=1e-5)
    for poses in (recording.truth, recording.odometry):
        assert poses is not None
        assert all(poses.at(time, TrajectoryConfig()) is not None for time in times)


def small_image(folder: Path) -> None:
    cv2.imwrite(str(folder / "depth" / "0.300.png"), np.ones((5, 4), np.uint16))


def broken_image(folder: Path) -> None:
    (folder / "depth" / "0.300.png").write_bytes(b"no image")


def huge_image(folder: Path) -> None:
    content = bytearray((folder / "depth" / "0.300.png").read_bytes())
    content[16:24] = struct.pack(">II", 32767, 32767)
    content[29:33] = struct.pack(">I", zlib.crc32(content[12:29]))
    (folder / "depth" / "0.300.png").write_bytes(content)


def colour_for_depth(folder: Path) -> None:
    cv2.imwrite(str(folder / "depth" / "0.300.png"), np.ones((240, 320, 3), np.uint8))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (small_image, r"0.300.png: .*5"),
        (broken_image, r"0.300.png: "),
        (huge_image, r"0.300.png: "),
        (colour_for_depth, r"0.300.png: .*uint8"),
    ],
)
def test_what_comes_before_a_bad_image_is_good(folder: Path, spoil, message: str, capfd) -> None:
    spoil(folder)
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    found = []
    with pytest.raises(InputError, match=message):
        found.extend(read_tum_folder(folder).frames())
    assert [frame.time for frame in found] == [0.0, 0.1, 0.2]
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used < 100_000  # kB
    assert not capfd.readouterr().err


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("rgb.txt", "now rgb/0.png\n", r"rgb.txt: line 1"),
        ("rgb.txt", "# nothing\n", r"rgb.txt: "),
        ("depth.txt", "# Zürich\n".encode("latin-1"), r"depth.txt: .*UTF-8"),
        ("groundtruth.txt", "1 2 3\n", r"groundtruth.txt: .*time x y z qx qy qz qw"),
        ("groundtruth.txt", "0 0 0 0 0 0 0 nan\n", r"groundtruth.txt: "),
        ("groundtruth.txt", "0 1e308 0 0 0 0 0 1\n", r"groundtruth.txt: .*8192 m"),
        ("groundtruth.txt", "0 0 0 0 0 0 0 0\n", r"groundtruth.txt: "),
        ("keyframes.txt", "0.1 1", r"keyframes.txt: .*time labelled stood"),
        ("calibration.txt", "500 500\n", r"calibration.txt: .*fx fy cx cy"),
        ("odometry.txt", "1e9 0 0 0 0 0 0 1\n", r"do not overlap.* 0.00 to 0.50 s"),
    ],
)
def test_bad_lists_are_one_line(folder: Path, name: str, content: str | bytes, message: str) -> None:
    (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(InputError, match=message) as raised:
        read_tum_folder(folder)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(("name", "make"), [("depth.txt", os.mkdir), ("calibration.txt", os.mkfifo)])
def test_a_list_is_a_file(name: str, make: Callable[[Path], None], folder: Path) -> None:
    (folder / name).unlink()
    make(folder / name)
    with pytest.raises(InputError, match=name):
        read_tum_folder(folder)


def test_a_folder_of_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"depth\.txt"):
        read_tum_folder(tmp_path)


def test_the_list_of_images_names_the_camera(folder: Path) -> None:
    assert read_tum_folder(folder).sensor is None
    lines = (folder / "depth.txt").read_text()
    (folder / "depth.txt").write_text(f"# depth maps\n# file: 'rgbd_dataset_freiburg1_desk.bag'\n{lines}")
    recording = read_tum_folder(folder)
    assert recording.sensor is not None and recording.sensor.nearest == 0.5
    assert any("freiburg1" in note for note in recording.notes)
