"""Exports of labelled points: the folders of S3DIS, and blocks in HDF5.

S3DIS: Armeni et al., "3D Semantic Parsing of Large-Scale Indoor Spaces", CVPR 2016. Blocks are the form in which
PointNet (Qi et al., CVPR 2017) and DGCNN read S3DIS.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Labels, Points
from pipeline.errors import required
from pipeline.geometry.thinning import first_in_voxels
from sarsim.dataset.exports.export import Export, label_names, room_name
from sarsim.dataset.hdf5 import NewFile
from sarsim.dataset.manifest import Dataset, SceneEntry
from sarsim.dataset.scene_file import Scene
from sarsim.dataset.settings import check_range

AREAS = {"train": "Area_1", "val": "Area_2", "test": "Area_5"}  # Published loaders hold out Area 5
CLASS_NAMES = (
    *("window", "wall", "floor", "beam", "table", "ceiling", "chair", "clutter"),
    *("column", "door", "sofa", "bookcase", "board"),
)
"""The classes of S3DIS, the only ones that published readers know; a label gets the name with its number as index."""
ROOM_LIST = "room_filelist.txt"
FILE_LIST = "all_files.txt"
BLOCK_SIDE = 1.0  # Side of a block in xy, m
SEED = 0  # Seed of the random choice of points


@dataclass(frozen=True, eq=False)
class Cloud:
    """Labelled points in the world frame.

    Attributes:
        points: (N, 3) float32 m, positions.
        rgb: (N, 3) uint8 colours.
        label: (N,) uint8 labels.
        instance: (N,) int32 geom ids, -1 = none.
    """

    points: Points
    rgb: NDArray[np.uint8]
    label: Labels
    instance: NDArray[np.int32]

    @classmethod
    def of_frame(cls, scene: Scene, index: int) -> Self:
        """All returns of a frame, placed in the world with the true pose."""
        frame = scene.frame(index)
        seen = frame.returns
        points = frame.points(scene.T_world_camera(index))
        return cls(points, frame.rgb[seen], required(frame.label)[seen], required(frame.instance)[seen])

    @classmethod
    def of_scene(cls, scene: Scene, voxel: float) -> Self:
        """The returns of all frames, thinned to one in each cube with sides of ``voxel`` m."""
        parts = [cls.of_frame(scene, index).thinned(voxel) for index in range(len(scene))]
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return cls(*map(np.concatenate, columns)).thinned(voxel)

    def thinned(self, voxel: float) -> Self:
        """The first point in every cube with sides of ``voxel`` m."""
        return self.select(first_in_voxels(self.points.astype(np.float64) / voxel))

    def select(self, chosen: NDArray) -> Self:
        """The points selected by indices or a mask."""
        return type(self)(*(column[chosen] for column in vars(self).values()))


@dataclass(frozen=True)
class S3dis(Export):
    """Area_N/room/room.txt and Annotations/<class>_<n>.txt, with lines of x y z (m) and r g b (0 to 255).

    Classes have S3DIS's names: floor is terrain, beam a slope, table a deck, chair a victim, window
    unlabelled. The lists in meta/ replace those of published readers, so that a class has the number of its label.
    """

    voxel: float = 0.02
    """Side of the cubes, m, in each of which one return of a scene is kept."""

    def __post_init__(self) -> None:
        check_range("voxel", self.voxel, 0.001)

    def add(self, folder: Path, entry: SceneEntry, scene: Scene) -> None:
        """Write a room for the scene, with a file for each object that is seen in it."""
        name = room_name(entry)
        annotations = folder / AREAS[entry.split] / name / "Annotations"
        annotations.mkdir(parents=True)
        cloud = Cloud.of_scene(scene, self.voxel)
        instances, numbers = object_ids(scene, cloud), Counter[str]()
        # Objects with one point are left out, because indoor3d_util.py joins tables and NumPy reads one line as a
        # vector.
        known, counts = np.unique(instances, return_counts=True)
        several = np.isin(instances, known[counts > 1])
        cloud, instances = cloud.select(several), instances[several]
        write_points(annotations.parent / f"{name}.txt", cloud)
        for instance in np.unique(instances):
            part = cloud.select(instances == instance)
            name = CLASS_NAMES[part.label[0]]
            numbers[name] += 1
            write_points(annotations / f"{name}_{numbers[name]}.txt", part)

    def finish(self, folder: Path, dataset: Dataset) -> None:
        """List classes and rooms for collect_indoor3d_data.py of pointnet and dgcnn.pytorch."""
        rooms = [(AREAS[entry.split], room_name(entry)) for entry in dataset.entries]
        (folder / "meta").mkdir()
        for name, lines in (
            ("class_names.txt", CLASS_NAMES),
            ("anno_paths.txt", [f"{area}/{arena}/Annotations" for area, arena in rooms]),
            ("all_data_label.txt", [f"{area}_{arena}.npy" for area, arena in rooms]),
        ):
            (folder / "meta" / name).write_text("".join(f"{line}\n" for line in lines))


def object_ids(scene: Scene, cloud: Cloud) -> NDArray[np.int32]:
    """(N,) int32 id of the object to which each point belongs; -1 for specks of dust."""
    return scene.content.object_of_geom[cloud.instance]


def write_points(path: Path, cloud: Cloud) -> None:
    """Write lines of x y z in m and r g b from 0 to 255."""
    lines = [
        f"{x:.3f} {y:.3f} {z:.3f} {r} {g} {b}\n"
        for (x, y, z), (r, g, b) in zip(cloud.points.tolist(), cloud.rgb.tolist(), strict=True)
    ]
    path.write_text("".join(lines))


@dataclass(frozen=True)
class Blocks(Export):
    """HDF5 files of blocks of 1 m × 1 m in xy, by default with 4096 points.

    A point has x y z, optionally r g b, and normalized x y z. all_files.txt lists the files by their paths
    from the parent folder; meta/class_names.txt names the labels.
    """

    points: int = 4096
    """Number of points drawn for a block, with repetition only if the block contains fewer."""
    min_points: int = 100
    """Minimum number of points in a block; blocks with fewer are left out."""
    colours: bool = False
    """Whether r g b, 0 to 1, come between the two kinds of coordinates, as in the nine channels of S3DIS."""

    def __post_init__(self) -> None:
        check_range("points", self.points, 1)
        check_range("min-points", self.min_points, 1)

    def add(self, folder: Path, entry: SceneEntry, scene: Scene) -> None:
        """Write one file for the scene; each frame is a separate room."""
        rng = np.random.default_rng([SEED, entry.index])
        blocks, rooms = [], []
        for index in range(len(scene)):
            new = list(self.of_cloud(Cloud.of_frame(scene, index), rng))
            blocks += new
            rooms += [f"{AREAS[entry.split]}_{room_name(entry)}_frame_{index}"] * len(new)
        name = f"ply_data_all_{entry.index}.h5"
        self._write(folder / name, blocks)
        # Published loaders (dgcnn.pytorch, pointnet) append these paths to the parent of this folder.
        for list_name, lines in ((FILE_LIST, [f"{folder.name}/{name}"]), (ROOM_LIST, rooms)):
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

        Channels: x and y from the block's centre and z from the lowest point, m; r g b from 0 to 1, if wanted; and
        x y z as fractions of the cloud's extent.
        """
        if not len(cloud.points):
            return
        xyz = cloud.points - cloud.points.min(axis=0)
        extent = np.maximum(xyz.max(axis=0), 1e-6)
        cells = np.floor(xyz[:, :2] / BLOCK_SIDE).astype(np.int64)
        for cell in np.unique(cells, axis=0):
            inside = np.flatnonzero((cells == cell).all(axis=1))
            if len(inside) < self.min_points:
                continue
            chosen = rng.choice(inside, self.points, replace=len(inside) < self.points)
            local = xyz[chosen].copy()
            local[:, :2] -= (cell + 0.5) * BLOCK_SIDE
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
