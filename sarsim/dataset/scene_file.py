"""One scene of a dataset as an HDF5 file; docs/dataset.md describes the format."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Frame, Intrinsics
from pipeline.labels import Label
from sarsim.closing import Closing
from sarsim.dataset import image_kernels
from sarsim.dataset.hdf5 import FAST, NewFile, open_file, write_noisy

FORMAT = "sarsim-scene"
VERSION = 1
MILLIMETRE = np.float32(0.001)
NO_BOX = -1

_IMAGES = {
    "rgb": ((3,), np.uint8),
    "depth": ((), np.uint16),
    "label": ((), np.uint8),
    "instance": ((), np.int16),
}
"""By name: what a pixel is, and its type. Noise makes colour all but incompressible, so it is kept as it is."""

_GROUPED = {"victim_pixels": "victims/pixels", "victim_area": "victims/area"}
"""Names in the file of what SceneFrame calls otherwise."""


@dataclass(frozen=True, eq=False)
class SceneContent:
    """What a scene has but for its frames.

    Attributes:
        settings: what it was made from, as JSON can hold it.
        mjcf: the arena's MJCF, without the robot.
        intrinsics: of all images.
        geom_name: (G,) of the geoms, by instance.
        geom_label: (G,) uint8.
        geom_victim: (G,) int16 index of the victim that a geom belongs to; -1 = none.
        victim_id: (V,) names.
        victim_pose: (V, 4, 4) T_world_victim.
        victim_box: (V, 2, 3) lowest and highest corner in the victim's own frame, m.
    """

    settings: dict[str, Any]
    mjcf: str
    intrinsics: Intrinsics
    geom_name: list[str]
    geom_label: NDArray[np.uint8]
    geom_victim: NDArray[np.int16]
    victim_id: list[str]
    victim_pose: NDArray[np.float64]
    victim_box: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SceneFrame:
    """One look.

    Attributes:
        time: s since the drive began.
        rgb: (H, W, 3) uint8.
        depth: (H, W) float32 m, 0 = no return.
        label: (H, W) uint8 of the surface that each pixel shows.
        instance: (H, W) int geom id of that surface; -1 = none.
        pose_true: 4×4 T_world_base.
        pose_odom: 4×4 T_odom_base.
        T_base_camera: 4×4.
        victim_pixels: (V, 4) int32 first and last column and row + 1 (u0, v0, u1, v1) of what is seen of each victim;
            -1 where nothing is.
        victim_area: (V,) int32 pixels that show each victim.
    """

    time: float
    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    label: NDArray[np.uint8]
    instance: NDArray[np.integer]
    pose_true: NDArray[np.float64]
    pose_odom: NDArray[np.float64]
    T_base_camera: NDArray[np.float64]
    victim_pixels: NDArray[np.int32]
    victim_area: NDArray[np.int32]


class SceneWriter(Closing):
    """Writes a scene's file, frame by frame; the same frames make the same bytes."""

    def __init__(self, path: Path, frames: int, content: SceneContent):
        """OSError here or later where the file cannot be written."""
        self._new = NewFile(path)
        self._file = self._new.file
        self._label_points = np.zeros(len(Label), np.int64)
        self._millimetres = np.empty((content.intrinsics.height, content.intrinsics.width), np.uint16)
        self._file.attrs["format"] = FORMAT
        self._file.attrs["version"] = VERSION
        self._file.attrs["settings"] = json.dumps(content.settings)
        k = content.intrinsics
        self._dataset("intrinsics", np.array([k.fx, k.fy, k.cx, k.cy]))
        self._dataset("mjcf", np.frombuffer(content.mjcf.encode(), np.uint8), **FAST)
        self._geoms(content)
        self._victims(content)
        for name, (pixel, dtype) in _IMAGES.items():
            shape = (k.height, k.width, *pixel)
            filters = {} if name == "rgb" else FAST | {"shuffle": np.dtype(dtype).itemsize > 1}
            self._empty(name, (frames, *shape), dtype, chunks=(1, *shape), **filters)
        self._rows = _rows(frames, len(content.victim_id))

    @property
    def label_points(self) -> NDArray[np.int64]:
        """(8,) returns so far by label."""
        return self._label_points

    def write(self, index: int, frame: SceneFrame) -> None:
        """Add one frame."""
        self._new.check()
        file = self._file
        file["rgb"][index] = frame.rgb
        image_kernels.to_millimetres(frame.depth, frame.label, self._millimetres, self._label_points)
        write_noisy(file["depth"], index, self._millimetres)
        file["label"][index] = frame.label
        file["instance"][index] = frame.instance.astype(np.int16)
        for name, values in self._rows.items():
            values[index] = getattr(frame, name)

    def close(self) -> None:
        """Write what is left; nothing more can be added."""
        for name, values in self._rows.items():
            self._dataset(_GROUPED.get(name, name), values)
        self._new.close()

    def _geoms(self, content: SceneContent) -> None:
        self._dataset("geoms/name", _fixed(content.geom_name))
        self._dataset("geoms/label", content.geom_label)
        self._dataset("geoms/victim", content.geom_victim)

    def _victims(self, content: SceneContent) -> None:
        self._dataset("victims/id", _fixed(content.victim_id))
        self._dataset("victims/pose", content.victim_pose)
        self._dataset("victims/box", content.victim_box)

    def _dataset(self, name: str, data: NDArray, **filters: Any) -> None:
        # A time of writing would make every file another one.
        self._file.create_dataset(name, data=data, track_times=False, **filters)

    def _empty(self, name: str, shape: tuple[int, ...], dtype: Any, **filters: Any) -> None:
        self._file.create_dataset(name, shape, dtype, track_times=False, **filters)


def _rows(frames: int, victims: int) -> dict[str, NDArray]:
    """Room for what is small of every frame, by its name in :class:`SceneFrame`; written in one go at the end."""
    poses = {name: np.zeros((frames, 4, 4)) for name in ("pose_true", "pose_odom", "T_base_camera")}
    boxes, areas = np.zeros((frames, victims, 4), np.int32), np.zeros((frames, victims), np.int32)
    return {**poses, "time": np.zeros(frames), "victim_pixels": boxes, "victim_area": areas}


def _fixed(names: list[str]) -> NDArray[np.bytes_]:
    return np.array([name.encode() for name in names], dtype=np.bytes_ if names else "S1")


class Scene(Closing):
    """Reads a scene's file.

    Attributes:
        path: of the file.
        settings: what the scene was made from.
        intrinsics: of all images.
        pose_true: (M, 4, 4) T_world_base.
        pose_odom: (M, 4, 4) T_odom_base.
        T_base_camera: (M, 4, 4).
        time: (M,) s.
    """

    def __init__(self, path: Path):
        """Open a file.

        Raises:
            InputError: it is missing, broken, or no scene of this version.
        """
        self.path = path
        self._file = open_file(path)
        try:
            self._read_head()
        except (KeyError, ValueError, OSError, RuntimeError) as error:
            self.close()
            if isinstance(error, InputError):
                raise
            raise InputError(f"{path}: broken: {' '.join(str(error).split())}") from error

    def _read_head(self) -> None:
        file = self._file
        _check_version(self.path, file)
        self.settings: dict[str, Any] = json.loads(file.attrs["settings"])
        frames, height, width = file["label"].shape
        fx, fy, cx, cy = map(float, file["intrinsics"][:])
        self.intrinsics = Intrinsics(width, height, fx, fy, cx, cy)
        self.pose_true, self.pose_odom = file["pose_true"][:], file["pose_odom"][:]
        self.T_base_camera, self.time = file["T_base_camera"][:], file["time"][:]
        for name, (pixel, _) in _IMAGES.items():
            if file[name].shape != (frames, height, width, *pixel):
                raise InputError(f"{self.path}: broken: {name} has the shape {file[name].shape}")

    def __len__(self) -> int:
        return len(self.time)

    def __iter__(self) -> Iterator[Frame]:
        return map(self.frame, range(len(self)))

    def frame(self, index: int) -> Frame:
        """One look, with its labels.

        Raises:
            InputError: the file is broken there.
        """
        return Frame(
            time=float(self.time[index]),
            rgb=self._image("rgb", index),
            depth=self._image("depth", index) * MILLIMETRE,
            intrinsics=self.intrinsics,
            T_base_camera=self.T_base_camera[index],
            T_odom_base=self.pose_odom[index],
            label=self.label(index),
            instance=self._image("instance", index).astype(np.int32),
        )

    def rgb(self, index: int) -> NDArray[np.uint8]:
        """(H, W, 3) colour image of a frame.

        Raises:
            InputError: the file is broken there.
        """
        return self._image("rgb", index)

    def label(self, index: int) -> NDArray[np.uint8]:
        """(H, W) labels of a frame.

        Raises:
            InputError: the file is broken there.
        """
        return self._image("label", index)

    def T_world_camera(self, index: int) -> NDArray[np.float64]:
        """4×4 true pose of ``camera_optical`` in a frame."""
        return self.pose_true[index] @ self.T_base_camera[index]

    @cached_property
    def mjcf(self) -> str:
        """The arena's MJCF."""
        return self._file["mjcf"][:].tobytes().decode()

    @cached_property
    def content(self) -> SceneContent:
        """All but the frames."""
        file = self._file
        return SceneContent(
            settings=self.settings,
            mjcf=self.mjcf,
            intrinsics=self.intrinsics,
            geom_name=[name.decode() for name in file["geoms/name"][:]],
            geom_label=file["geoms/label"][:],
            geom_victim=file["geoms/victim"][:],
            victim_id=[name.decode() for name in file["victims/id"][:]],
            victim_pose=file["victims/pose"][:],
            victim_box=file["victims/box"][:],
        )

    @cached_property
    def victim_pixels(self) -> NDArray[np.int32]:
        """(M, V, 4) boxes u0, v0, u1, v1 around what is seen of each victim; -1 where nothing is."""
        return self._file["victims/pixels"][:]

    @cached_property
    def victim_area(self) -> NDArray[np.int32]:
        """(M, V) pixels that show each victim."""
        return self._file["victims/area"][:]

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _image(self, name: str, index: int) -> NDArray:
        try:
            return self._file[name][index]
        except (OSError, RuntimeError) as error:
            raise InputError(f"{self.path}: broken: {name} of frame {index} cannot be read") from error


def _check_version(path: Path, file: h5py.File) -> None:
    if file.attrs.get("format") != FORMAT:
        raise InputError(f"{path}: not a scene of a dataset")
    if (version := file.attrs.get("version")) != VERSION:
        raise InputError(f"{path}: format version {version}; this program reads version {VERSION}")
