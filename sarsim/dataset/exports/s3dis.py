"""Folders in the layout of S3DIS (Armeni et al., "3D Semantic Parsing of Large-Scale Indoor Spaces", CVPR 2016)."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sarsim.dataset.exports.clouds import Cloud
from sarsim.dataset.exports.export import Export, room
from sarsim.dataset.folder import Dataset
from sarsim.dataset.manifest import SceneEntry
from sarsim.dataset.scene_file import Scene
from sarsim.dataset.settings import check

AREAS = {"train": "Area_1", "val": "Area_2", "test": "Area_5"}  # Published loaders hold out Area 5
NAMES = (
    *("window", "wall", "floor", "beam", "table", "ceiling", "chair", "clutter"),
    *("column", "door", "sofa", "bookcase", "board"),
)
"""The classes of S3DIS, because published readers know no others; a label is named by its index in this list."""


@dataclass(frozen=True)
class S3dis(Export):
    """Area_N/room/room.txt and Annotations/<class>_<n>.txt, with lines of x y z (m) and r g b (0 to 255).

    Classes have S3DIS's names: floor is terrain, beam an inclined ramp, table a straight ramp, chair a victim, window
    unlabelled. The lists in meta/ replace those of published readers, so that a class has the number of its label.
    """

    voxel: float = 0.02
    """Side of a cube, m; of the returns of a scene, one is kept in each cube."""

    def __post_init__(self) -> None:
        check("voxel", self.voxel, 0.001)

    def add(self, folder: Path, entry: SceneEntry, scene: Scene) -> None:
        """Write a room for the scene, with a file for each geom or victim that is seen in it."""
        name = room(entry)
        annotations = folder / AREAS[entry.split] / name / "Annotations"
        annotations.mkdir(parents=True)
        cloud = Cloud.of_scene(scene, self.voxel)
        instances, numbers = objects(scene, cloud), Counter[str]()
        # Objects with one point are left out: indoor3d_util.py joins tables, and NumPy reads one line as a vector.
        known, counts = np.unique(instances, return_counts=True)
        several = np.isin(instances, known[counts > 1])
        cloud, instances = cloud.of(several), instances[several]
        write_lines(annotations.parent / f"{name}.txt", cloud)
        for instance in np.unique(instances):
            part = cloud.of(instances == instance)
            name = NAMES[part.label[0]]
            numbers[name] += 1
            write_lines(annotations / f"{name}_{numbers[name]}.txt", part)

    def finish(self, folder: Path, dataset: Dataset) -> None:
        """List classes and rooms for collect_indoor3d_data.py of pointnet and dgcnn.pytorch."""
        rooms = [(AREAS[entry.split], room(entry)) for entry in dataset.entries]
        (folder / "meta").mkdir()
        for name, lines in (
            ("class_names.txt", NAMES),
            ("anno_paths.txt", [f"{area}/{arena}/Annotations" for area, arena in rooms]),
            ("all_data_label.txt", [f"{area}_{arena}.npy" for area, arena in rooms]),
        ):
            (folder / "meta" / name).write_text("".join(f"{line}\n" for line in lines))


def objects(scene: Scene, cloud: Cloud) -> NDArray[np.int64]:
    """(N,) the number of each point's object: a geom, or all geoms of a victim; -1 for specks of dust."""
    # Index -1, no geom, selects the element appended at the end.
    victim = np.append(scene.content.geom_victim, -1).astype(np.int64)[cloud.instance]
    return np.where(victim >= 0, len(scene.content.geom_name) + victim, cloud.instance)


def write_lines(path: Path, cloud: Cloud) -> None:
    """Write lines of x y z in m and r g b from 0 to 255."""
    lines = [
        f"{x:.3f} {y:.3f} {z:.3f} {r} {g} {b}\n"
        for (x, y, z), (r, g, b) in zip(cloud.points.tolist(), cloud.rgb.tolist(), strict=True)
    ]
    path.write_text("".join(lines))
