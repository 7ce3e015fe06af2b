"""Scans in the layout of SemanticKITTI (Behley et al., ICCV 2019), for its tools and for KITTI's.

``lidar/labels.yaml`` is a label table with the keys of the benchmark's ``semantic-kitti.yaml``. Each sequence is a
folder ``lidar/sequences/NN``:

- ``velodyne/*.bin``: one scan each, with rows of float32 x, y, z, m in the lidar's frame, and intensity;
- ``labels/*.label``: uint32 of each point, the label in the lower 16 bits and 1 + the geom id in the upper ones;
- ``poses.txt``: the first three rows of the lidar's true pose in the world, a line for each scan;
- ``calib.txt``: identities, because the poses are the lidar's own; ``times.txt``: start time of each scan, s;
- ``trajectory_true.tum``: the poses and times in the TUM layout, which evo and other tools read.
"""

import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import yaml

from pipeline.arrays import Pose
from pipeline.errors import InputError
from pipeline.files import atomic_write
from pipeline.labels import COLOURS, Label
from pipeline.localisation.trajectory import write_tum
from sarsim.plugins.lidar.scanner import Scan

FOLDER, LABELS = "lidar", "labels.yaml"
DIGITS = 9  # significant digits of poses: 1 µm at 1 km
INSTANCE_BITS = 16
SPLITS = {"train": "train", "val": "valid", "test": "test"}
"""Names of the splits in the benchmark's table, by their names in a dataset."""


def sequence_folder(folder: Path, number: int) -> Path:
    """Folder of a sequence below a run's or a dataset's folder."""
    return folder / FOLDER / "sequences" / f"{number:02d}"


class SequenceWriter:
    """Writes the files of one sequence, scan by scan.

    Attributes:
        scans, points: numbers of scans and points written so far.
    """

    def __init__(self, folder: Path):
        """Replace the folder with an empty one; InputError if it cannot be written."""
        self._folder = folder
        self.scans, self.points = 0, 0
        self._times, self._poses = list[float](), list[Pose]()
        try:
            shutil.rmtree(folder, ignore_errors=True)
            for kind in ("velodyne", "labels"):
                (folder / kind).mkdir(parents=True)
        except OSError as error:
            raise self._unwritable(error) from error

    def _unwritable(self, error: OSError) -> InputError:
        return InputError(f"{self._folder}: cannot be written: {error.strerror or error}")

    def add(self, scan: Scan) -> None:
        """Write a scan; InputError if it cannot be written."""
        points = np.column_stack([scan.points, scan.intensity]).astype("<f4")
        ids = scan.label.astype("<u4") | (scan.instance + 1).astype("<u4") << np.uint32(INSTANCE_BITS)
        name = f"{self.scans:06d}"
        try:
            points.tofile(self._folder / "velodyne" / f"{name}.bin")
            ids.astype("<u4").tofile(self._folder / "labels" / f"{name}.label")
        except OSError as error:
            raise self._unwritable(error) from error
        self._times.append(scan.start)
        self._poses.append(scan.T_world_lidar)
        self.scans, self.points = self.scans + 1, self.points + len(scan)

    def save(self) -> None:
        """Write the poses, the times and the calibration; InputError if they cannot be written."""
        identity = _row(np.eye(4))
        calibration = "".join(f"{name}: {identity}\n" for name in ("P0", "P1", "P2", "P3", "Tr"))
        texts = {
            "poses.txt": "".join(f"{_row(T)}\n" for T in self._poses),
            "times.txt": "".join(f"{time:.6e}\n" for time in self._times),
            "calib.txt": calibration,
        }
        for name, text in texts.items():
            with atomic_write(self._folder / name) as path:
                path.write_text(text)
        write_tum(self._folder / "trajectory_true.tum", self._times, self._poses)


def _row(T: Pose) -> str:
    return " ".join(f"{value:.{DIGITS}g}" for value in T[:3].ravel())


def write_label_table(folder: Path, splits: Mapping[int, str]) -> None:
    """Write the label table into a run's or a dataset's folder; ``splits``: train, val or test by sequence.

    Raises:
        InputError: the table cannot be written.
    """
    numbers = {int(label): int(label) for label in Label}
    table = {
        "labels": {int(label): label.name.lower() for label in Label},
        "color_map": {int(label): COLOURS[label][::-1].tolist() for label in Label},  # blue, green, red
        "learning_map": numbers,
        "learning_map_inv": numbers,
        "learning_ignore": {int(label): label is Label.UNLABELLED for label in Label},
        "split": {name: [n for n, split in splits.items() if split == own] for own, name in SPLITS.items()},
    }
    with atomic_write(folder / FOLDER / LABELS) as path:
        path.write_text("".join(yaml.safe_dump({key: value}, sort_keys=False) for key, value in table.items()))
