"""One scene of a dataset as an HDF5 file; docs/dataset.md describes the format."""

import json
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Boxes, Labels, Pose, Poses
from pipeline.datasets.recording import Recording
from pipeline.errors import InputError, required
from pipeline.frame import Frame, Intrinsics
from pipeline.labels import Label
from pipeline.localisation.trajectory import Trajectory
from pipeline.sensor import XTION
from pipeline.transforms import are_poses
from sarsim.dataset import image_kernels
from sarsim.dataset.hdf5 import FAST_COMPRESSION, NewFile, open_file, write_noisy

SCENE_FORMAT = "sarsim-scene"
SCENE_VERSION = 1
DEPTH_SCALE = np.float32(
    1000
)  # Depth units per metre; readers of other formats divide too, so the depths are the same
NO_BOX = -1

_IMAGES = {"rgb": ((3,), np.uint8), "depth": ((), np.uint16), "label": ((), np.uint8), "instance": ((), np.int16)}
"""Shape and type of a pixel of each image; colour images are not compressed, because noise hardly compresses."""

_CONTENT = {
    name: name.replace("s/", "_")
    for name in (
        "geoms/name",
        "geoms/label",
        "geoms/victim",
        "geoms/object",
        "victims/id",
        "victims/pose",
        "victims/box",
    )
}  # The attribute of :class:`SceneContent` for each name in the file

_LAYOUT: dict[str, tuple[str, *tuple[str | int, ...]]] = {
    "rgb": ("u1", "M", "H", "W", 3),
    "depth": ("u2", "M", "H", "W"),
    "label": ("u1", "M", "H", "W"),
    "instance": ("i2", "M", "H", "W"),
    "intrinsics": ("f8", 4),  # fx, fy, cx, cy
    "time": ("f8", "M"),
    "pose_true": ("f8", "M", 4, 4),
    "pose_odom": ("f8", "M", 4, 4),
    "T_base_camera": ("f8", "M", 4, 4),
    "victims/pixels": ("i4", "M", "V", 4),
    "victims/area": ("i4", "M", "V"),
    "mjcf": ("u1", "X"),
    "geoms/name": ("S", "G"),
    "geoms/label": ("u1", "G"),
    "geoms/victim": ("i2", "G"),
    "geoms/object": ("i2", "G"),
    "victims/id": ("S", "V"),
    "victims/pose": ("f8", "V", 4, 4),
    "victims/box": ("f8", "V", 2, 3),
}
"""Type and shape of every dataset in a file; a letter stands for the same size everywhere."""
OPTIONAL_DATASETS = ("geoms/object",)
"""Datasets that older files of this version lack."""
MAX_BYTES = 2**28
"""Maximum size of a frame's image or of any other dataset, bytes; a small file may claim to hold terabytes."""
MAX_FRAMES = 100_000


@dataclass(frozen=True, eq=False)
class SceneContent:
    """The content of a scene without its frames.

    Attributes:
        settings: the scene's recipe as JSON values.
        mjcf: the arena's MJCF, without the robot.
        intrinsics: camera intrinsics of all images.
        geom_name: (G,) names of the geoms, by instance id.
        geom_label: (G,) uint8 labels of the geoms.
        geom_victim: (G,) int16 index of the victim to which each geom belongs; -1 = none.
        geom_object: (G,) int16 id of the object to which each geom belongs: the id of the object's first geom.
        victim_id: (V,) names of the victims.
        victim_pose: (V, 4, 4) poses T_world_victim.
        victim_box: (V, 2, 3) lowest and highest corner in the victim's own frame, m.
    """

    settings: dict[str, Any]
    mjcf: str
    intrinsics: Intrinsics
    geom_name: list[str]
    geom_label: Labels
    geom_victim: NDArray[np.int16]
    geom_object: NDArray[np.int16]
    victim_id: list[str]
    victim_pose: Poses
    victim_box: Boxes

    @property
    def object_of_geom(self) -> NDArray[np.int32]:
        """(G + 1,) int32 ``geom_object`` and a final -1, which the instance -1 of a pixel without a geom selects."""
        return np.append(self.geom_object, -1).astype(np.int32)


@dataclass(frozen=True, eq=False)
class SceneFrame:
    """One frame of a scene, with its ground truth.

    Attributes:
        frame: the robot's frame, with label and instance images.
        pose_true: 4×4 true pose T_world_base.
        victim_pixels: (V, 4) int32 first column and row, last column and row + 1 (u0, v0, u1, v1) of the visible part
            of each victim; -1 if nothing is visible.
        victim_area: (V,) int32 number of pixels that show each victim.
    """

    frame: Frame
    pose_true: Pose
    victim_pixels: NDArray[np.int32]
    victim_area: NDArray[np.int32]


class SceneWriter(ExitStack):
    """Writes a scene's file, frame by frame; the same frames give the same bytes.

    Attributes:
        label_points: (8,) number of depth returns of each label so far.
    """

    def __init__(self, path: Path, frames: int, content: SceneContent):
        """Create the file; OSError, here or later, if the file cannot be written."""
        super().__init__()
        self._new = self.enter_context(NewFile(path))
        self._file = self._new.file
        self._rows: dict[str, list[Any]] = defaultdict(list)
        self.callback(self._write_rows)
        self.label_points = np.zeros(len(Label), np.int64)
        k = content.intrinsics
        self._millimetres = np.empty((k.height, k.width), np.uint16)
        self._file.attrs.update(format=SCENE_FORMAT, version=SCENE_VERSION, settings=json.dumps(content.settings))
        self._dataset("intrinsics", np.array([k.fx, k.fy, k.cx, k.cy]))
        self._dataset("mjcf", np.frombuffer(content.mjcf.encode(), np.uint8), **FAST_COMPRESSION)
        for name, attribute in _CONTENT.items():
            self._dataset(name, _as_array(getattr(content, attribute)))
        for name, (pixel, dtype) in _IMAGES.items():
            shape = (k.height, k.width, *pixel)
            filters = {} if name == "rgb" else FAST_COMPRESSION | {"shuffle": np.dtype(dtype).itemsize > 1}
            self._file.create_dataset(name, (frames, *shape), dtype, chunks=(1, *shape), track_times=False, **filters)

    def write(self, scene_frame: SceneFrame) -> None:
        """Add the next frame."""
        self._new.check()
        file, index, frame = self._file, len(self._rows["time"]), scene_frame.frame
        label, instance = required(frame.label), required(frame.instance)
        file["rgb"][index] = frame.rgb
        image_kernels.to_millimetres(frame.depth, label, self._millimetres, self.label_points)
        write_noisy(file["depth"], index, self._millimetres)
        file["label"][index] = label
        file["instance"][index] = instance.astype(np.int16)
        row = {
            "time": frame.time,
            "pose_true": scene_frame.pose_true,
            "pose_odom": frame.T_odom_base,
            "T_base_camera": frame.T_base_camera,
            "victims/pixels": scene_frame.victim_pixels,
            "victims/area": scene_frame.victim_area,
        }
        for name, value in row.items():
            self._rows[name].append(value)

    def _write_rows(self) -> None:
        for name, values in self._rows.items():
            self._dataset(name, np.array(values))

    def _dataset(self, name: str, data: NDArray, **filters: Any) -> None:
        # With timestamps, the same data would not give the same bytes.
        self._file.create_dataset(name, data=data, track_times=False, **filters)


def _as_array(values: NDArray | list[str]) -> NDArray:
    """Arrays unchanged; names as an array of fixed-length bytes."""
    if isinstance(values, np.ndarray):
        return values
    return np.array([name.encode() for name in values], dtype=np.bytes_ if values else "S1")


class Scene(ExitStack):
    """Reads a scene's file.

    Attributes:
        path: the scene's file.
        settings: the scene's recipe as JSON values.
        intrinsics: camera intrinsics of all images.
        pose_true: (M, 4, 4) true poses T_world_base.
        pose_odom: (M, 4, 4) dead-reckoned poses T_odom_base.
        T_base_camera: (M, 4, 4) poses of ``camera_optical`` in ``base_link``.
        time: (M,) s, times of the frames.
        victim_pixels: (M, V, 4) int32 boxes u0, v0, u1, v1 around the visible part of each victim; -1 if
            nothing is visible.
        victim_area: (M, V) int32 number of pixels that show each victim.
    """

    def __init__(self, path: Path):
        """Open a file; InputError if it is missing, broken, or not a scene of this format version."""
        super().__init__()
        self.path = path
        self._file = self.enter_context(open_file(path))
        try:
            with self._reporting_damage():
                self._read_head()
        except InputError:
            self.close()
            raise

    @contextmanager
    def _reporting_damage(self) -> Iterator[None]:
        """Turn exceptions caused by a broken file into InputError."""
        try:
            yield
        except InputError:
            raise
        except (KeyError, ValueError, TypeError, OSError, RuntimeError, RecursionError) as error:
            raise self._damaged(" ".join(str(error).strip('"').split())) from error

    def _damaged(self, what: str) -> InputError:
        return InputError(f"{self.path}: damaged: {what}; generate the scene again")

    def _read_head(self) -> None:
        file = self._file
        if file.attrs.get("format") != SCENE_FORMAT:
            raise InputError(f"{self.path}: not a dataset scene: its attribute 'format' must be {SCENE_FORMAT!r}")
        if (version := file.attrs.get("version")) != SCENE_VERSION:
            raise InputError(
                f"{self.path}: has format version {version}, but this sarsim reads only version {SCENE_VERSION}"
            )
        self.settings: dict[str, Any] = json.loads(file.attrs["settings"])
        if not isinstance(self.settings, dict) or not isinstance(self.settings.get("dust", 0.0), float | int):
            raise ValueError("its settings must be a JSON object in which dust, if given, is a number")
        sizes = self._check_layout()
        fx, fy, cx, cy = map(float, file["intrinsics"][:])
        self.intrinsics = Intrinsics(sizes["W"], sizes["H"], fx, fy, cx, cy)
        self.pose_true, self.pose_odom = file["pose_true"][:], file["pose_odom"][:]
        self.T_base_camera, self.time = file["T_base_camera"][:], file["time"][:]
        self.victim_pixels, self.victim_area = file["victims/pixels"][:], file["victims/area"][:]
        self._geoms = sizes["G"]
        self._check_numbers()

    def _check_layout(self) -> dict[str, int]:
        """Return each letter's size; ValueError if a dataset is external or huge, or has the wrong type or shape."""
        sizes: dict[str, int] = {}
        for name, (kind, *shape) in _LAYOUT.items():
            if name in OPTIONAL_DATASETS and name not in self._file:
                continue
            part = self._file[name]
            if part.file.filename != self._file.filename or part.external or part.is_virtual:
                raise ValueError(f"{name} must not refer to another file")
            if part.ndim != len(shape) or any(
                n != (want if isinstance(want, int) else sizes.setdefault(want, n))
                for want, n in zip(shape, part.shape, strict=True)
            ):
                wanted = ", ".join(str(sizes.get(str(size), size)) for size in shape)
                raise ValueError(f"{name} must have shape ({wanted}), not {part.shape}")
            if part.dtype.kind != "S" if kind == "S" else part.dtype != np.dtype(kind):
                wanted = "fixed-length strings" if kind == "S" else f"type {np.dtype(kind)}"
                raise ValueError(f"{name} must have {wanted}, not {part.dtype}")
            if part.nbytes > (most := MAX_BYTES * (sizes["M"] if name in _IMAGES else 1)):
                raise ValueError(f"{name} has {part.nbytes} bytes; the limit is {most} bytes")
        if sizes["M"] > MAX_FRAMES:
            raise ValueError(f"the scene has {sizes['M']} frames; the limit is {MAX_FRAMES}")
        return sizes

    def _check_numbers(self) -> None:
        """Raise ValueError if a number is out of range."""
        k, content = self.intrinsics, self.content
        if not np.isfinite([k.fx, k.fy, k.cx, k.cy]).all() or min(k.fx, k.fy) <= 0:
            raise ValueError(
                f"intrinsics must be finite with positive focal lengths, not {k.fx:g} {k.fy:g} {k.cx:g} {k.cy:g}"
            )
        for name in ("pose_true", "pose_odom", "T_base_camera"):
            if not are_poses(getattr(self, name)):
                raise ValueError(f"{name} contains a matrix that is not a rigid transform")
        if not (np.isfinite(self.time).all() and (np.diff(self.time) > 0).all()):
            raise ValueError("the frame times must be finite and strictly increasing")
        if (content.geom_label >= len(Label)).any():
            raise ValueError(f"geoms/label contains {content.geom_label.max()}; labels must be below {len(Label)}")
        count, victims = len(content.victim_id), content.geom_victim
        if (wrong := victims[(victims < -1) | (victims >= count)]).size:
            raise ValueError(
                f"geoms/victim contains {wrong[0]}, which is neither -1 nor an index of the {count} victims"
            )
        objects, geoms = content.geom_object, len(content.geom_name)
        if (wrong := objects[(objects < 0) | (objects >= geoms)]).size:
            raise ValueError(f"geoms/object contains {wrong[0]}, which is not an index of the {geoms} geoms")
        boxes = self.victim_pixels[self.victim_area > 0]
        if (boxes[:, :2] < 0).any() or (boxes[:, 2:] <= boxes[:, :2]).any() or (boxes > MAX_BYTES).any():
            raise ValueError(
                f"boxes in victims/pixels must have 0 ≤ u0 < u1 and 0 ≤ v0 < v1, and be below {MAX_BYTES}"
            )

    def __len__(self) -> int:
        return len(self.time)

    def __iter__(self) -> Iterator[Frame]:
        return map(self.frame, range(len(self)))

    def __getitem__(self, index: int) -> Frame:
        """One frame, counted from the end if the index is negative; IndexError if there is none."""
        return self.frame(range(len(self))[index])

    def frame(self, index: int) -> Frame:
        """One frame, with its labels; InputError if the file is broken."""
        return Frame(
            time=float(self.time[index]),
            rgb=self._image("rgb", index),
            depth=np.asarray(self._image("depth", index) / DEPTH_SCALE, np.float32),
            intrinsics=self.intrinsics,
            T_base_camera=self.T_base_camera[index],
            T_odom_base=self.pose_odom[index],
            label=self.label(index),
            instance=self._integer_image("instance", index, -1, self._geoms).astype(np.int32),
        )

    def label(self, index: int) -> NDArray[np.uint8]:
        """(H, W) labels of a frame; InputError if the file is broken."""
        return self._integer_image("label", index, 0, len(Label))

    def T_world_camera(self, index: int) -> Pose:
        """True pose of ``camera_optical`` in a frame."""
        return self.pose_true[index] @ self.T_base_camera[index]

    @cached_property
    def content(self) -> SceneContent:
        """The scene's content without the frames; InputError if the file is broken."""
        with self._reporting_damage():
            arrays = {attribute: self._file[name][:] for name, attribute in _CONTENT.items() if name in self._file}
            arrays.setdefault("geom_object", _objects_by_victims(arrays["geom_victim"]))
            for names in ("geom_name", "victim_id"):
                arrays[names] = [name.decode() for name in arrays[names]]
            mjcf = self._file["mjcf"][:].tobytes().decode()
        return SceneContent(settings=self.settings, mjcf=mjcf, intrinsics=self.intrinsics, **arrays)

    def _integer_image(self, name: str, index: int, start: int, end: int) -> NDArray:
        """An image of a frame whose values are integers; InputError unless they are from ``start`` to ``end`` - 1."""
        image = self._image(name, index)
        if image.size and not start <= image.min() <= image.max() < end:
            raise self._damaged(
                f"{name} of frame {index} has values from {image.min()} to {image.max()};"
                f" they must be between {start} and {end - 1}"
            )
        return image

    def _image(self, name: str, index: int) -> NDArray:
        try:
            return self._file[name][index]
        except (OSError, RuntimeError) as error:
            raise self._damaged(f"{name} of frame {index} cannot be read") from error


def _objects_by_victims(geom_victim: NDArray[np.int16]) -> NDArray[np.int16]:
    """(G,) object ids for a file without them: a victim's geoms form one object, every other geom forms its own."""
    owners = np.where(geom_victim >= 0, geom_victim, -1 - np.arange(len(geom_victim)))
    _, first, part = np.unique(owners, return_index=True, return_inverse=True)
    return first[part].astype(np.int16)


def read_scene(path: Path) -> Recording:
    """The frames and the dead-reckoned and true trajectories of a scene; InputError if its file cannot be read."""

    def frames() -> Iterator[Frame]:
        with Scene(path) as scene:
            yield from (replace(frame, T_odom_base=np.eye(4)) for frame in scene)

    with Scene(path) as scene:
        odometry, truth = (Trajectory(scene.time, poses) for poses in (scene.pose_odom, scene.pose_true))
    return Recording(path, frames, has_camera_pose=True, odometry=odometry, truth=truth, sensor=XTION)
