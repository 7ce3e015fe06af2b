"""Blocks of points in HDF5, the form in which PointNet (Qi et al., CVPR 2017) and DGCNN read S3DIS."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sarsim.dataset.exports.clouds import Cloud
from sarsim.dataset.exports.export import Export, label_names, room
from sarsim.dataset.exports.s3dis import AREAS
from sarsim.dataset.folder import Dataset
from sarsim.dataset.hdf5 import NewFile
from sarsim.dataset.manifest import SceneEntry
from sarsim.dataset.scene_file import Scene
from sarsim.dataset.settings import check

LIST = "room_filelist.txt"
FILES = "all_files.txt"
SIZE = 1.0  # Side of a block in xy, m
SEED = 0  # Seed of the random choice of points


@dataclass(frozen=True)
class Blocks(Export):
    """HDF5 files of blocks of 1 m × 1 m in xy, by default with 4096 points.

    A point has x y z, optionally r g b, and normalized x y z. all_files.txt lists the files by their paths
    from the parent folder; meta/class_names.txt names the labels.
    """

    points: int = 4096
    """Number of points in a block; drawn with repetition only if there are fewer."""
    min_points: int = 100
    """Blocks with fewer points than this are left out."""
    colours: bool = False
    """Whether r g b, 0 to 1, come between both kinds of coordinates, as in the nine channels of S3DIS."""

    def __post_init__(self) -> None:
        check("points", self.points, 1)
        check("min-points", self.min_points, 1)

    def add(self, folder: Path, entry: SceneEntry, scene: Scene) -> None:
        """Write one file for the scene; each frame is a separate room."""
        rng = np.random.default_rng([SEED, entry.index])
        blocks, rooms = [], []
        for index in range(len(scene)):
            new = list(self.of_cloud(Cloud.of_frame(scene, index), rng))
            blocks += new
            rooms += [f"{AREAS[entry.split]}_{room(entry)}_frame_{index}"] * len(new)
        name = f"ply_data_all_{entry.index}.h5"
        self._write(folder / name, blocks)
        # Published loaders (dgcnn.pytorch, pointnet) append these paths to the parent of this folder.
        for list_name, lines in ((FILES, [f"{self.out.name}/{name}"]), (LIST, rooms)):
            with (folder / list_name).open("a") as file:
                file.writelines(f"{line}\n" for line in lines)

    def finish(self, folder: Path, dataset: Dataset) -> None:
        """Write the labels' names in the order of their numbers."""
        (folder / "meta").mkdir()
        (folder / "meta" / "class_names.txt").write_text(label_names())

    def of_cloud(
        self, cloud: Cloud, rng: np.random.Generator
    ) -> Iterator[tuple[NDArray[np.float32], NDArray[np.uint8]]]:
        """The blocks of a cloud, (points, 6 or 9) each, with their (points,) labels.

        Channels: x and y from the block's centre, z from the lowest point, colours if wanted, and x y z as shares
        of the cloud's extent.
        """
        if not len(cloud.points):
            return
        xyz = cloud.points - cloud.points.min(axis=0)
        extent = np.maximum(xyz.max(axis=0), 1e-6)
        cells = np.floor(xyz[:, :2] / SIZE).astype(np.int64)
        for cell in np.unique(cells, axis=0):
            inside = np.flatnonzero((cells == cell).all(axis=1))
            if len(inside) < self.min_points:
                continue
            chosen = rng.choice(inside, self.points, replace=len(inside) < self.points)
            local = xyz[chosen].copy()
            local[:, :2] -= (cell + 0.5) * SIZE
            colours = cloud.rgb[chosen] / np.iinfo(np.uint8).max if self.colours else np.zeros((self.points, 0))
            block = np.concatenate([local, colours, xyz[chosen] / extent], axis=1)
            yield block.astype(np.float32), cloud.label[chosen]

    def _write(self, path: Path, blocks: list[tuple[NDArray[np.float32], NDArray[np.uint8]]]) -> None:
        channels = 9 if self.colours else 6
        data = np.array([block for block, _ in blocks], np.float32).reshape(-1, self.points, channels)
        label = np.array([labels for _, labels in blocks], np.uint8).reshape(-1, self.points)
        with NewFile(path) as new:
            for name, values in (("data", data), ("label", label)):
                filters = {"compression": "gzip"} if len(values) else {}
                new.file.create_dataset(name, data=values, track_times=False, **filters)
