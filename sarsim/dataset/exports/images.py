"""Exports of images with the objects in them: COCO's format (Lin et al., ECCV 2014) and YOLO's."""

import json
import logging
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import required
from pipeline.labels import Label
from sarsim.dataset.exports.export import ImageExport
from sarsim.dataset.manifest import SPLITS, Dataset, SceneEntry
from sarsim.dataset.scene_file import Scene, SceneContent

_log = logging.getLogger(__name__)
CATEGORIES = [{"id": int(label), "name": label.name.lower()} for label in Label if label is not Label.UNLABELLED]


@dataclass(frozen=True)
class Coco(ImageExport):
    """images/<split>/*.jpg and annotations/<split>.json: boxes and masks of all labelled objects."""

    _splits: dict[str, dict[str, list[dict[str, Any]]]] = field(default_factory=dict, init=False)

    def add(self, folder: Path, entry: SceneEntry, scene: Scene) -> None:
        """Write an image for each frame, and collect the annotations of the objects in it."""
        split = self._splits.setdefault(entry.split, {"images": [], "annotations": []})
        k = scene.intrinsics
        for name, frame in self.write_images(folder, entry, scene):
            image = len(split["images"]) + 1
            split["images"].append({"id": image, "file_name": f"{name}.jpg", "width": k.width, "height": k.height})
            for category, mask in object_masks(required(frame.instance), scene.content, self.min_area):
                about = {"id": len(split["annotations"]) + 1, "image_id": image, "category_id": category}
                split["annotations"].append(about | annotation(mask))

    def finish(self, folder: Path, dataset: Dataset) -> None:
        """Write an annotation file for each split."""
        (folder / "annotations").mkdir()
        for name, split in self._splits.items():
            content = {"info": {"description": f"sarsim, {name}"}, "categories": CATEGORIES, **split}
            (folder / "annotations" / f"{name}.json").write_text(json.dumps(content))


def object_masks(
    instance: NDArray[np.int32], content: SceneContent, min_area: int
) -> Iterator[tuple[int, NDArray[np.bool_]]]:
    """Label and (H, W) mask of each object that covers at least ``min_area`` pixels of an image.

    ``instance``: (H, W) geom ids, -1 = none. Objects whose label is unlabelled are left out.
    """
    merged = content.object_of_geom[instance]
    for number, area in zip(*np.unique(merged[merged >= 0], return_counts=True), strict=True):
        label = int(content.geom_label[number])
        if area >= min_area and label != Label.UNLABELLED:
            yield label, merged == number


def annotation(mask: NDArray[np.bool_]) -> dict[str, Any]:
    """Box (x, y, width, height in pixels), area and run lengths of a non-empty (H, W) mask."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    box = [int(columns[0]), int(rows[0]), int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1]
    return {
        "bbox": box,
        "area": int(mask.sum()),
        "iscrowd": 0,
        "segmentation": {"size": list(mask.shape), "counts": run_lengths(mask)},
    }


def run_lengths(mask: NDArray[np.bool_]) -> str:
    """An (H, W) mask in COCO's compressed RLE, as text.

    The run lengths are column-major; from the fourth on, each is stored minus the length two runs before. Each
    character holds 5 bits of a number.
    """
    flat = np.concatenate([[False], mask.ravel(order="F"), [not mask[-1, -1]]])
    counts = np.diff(np.flatnonzero(flat[1:] != flat[:-1]), prepend=0)
    letters = []
    for k, count in enumerate(counts.tolist()):
        rest = count - int(counts[k - 2]) if k > 2 else count
        while True:
            bits, rest = rest & 31, rest >> 5
            is_last = rest == (-1 if bits & 16 else 0)
            letters.append(chr(48 + bits + (0 if is_last else 32)))
            if is_last:
                break
    return "".join(letters)


@dataclass(frozen=True)
class Yolo(ImageExport):
    """images/<split>/*.jpg, labels/<split>/*.txt with lines of class x y width height, and data.yaml."""

    def add(self, folder: Path, entry: SceneEntry, scene: Scene) -> None:
        """Write an image and a text file for each frame."""
        labels = folder / "labels" / entry.split
        labels.mkdir(parents=True, exist_ok=True)
        size = np.array([scene.intrinsics.width, scene.intrinsics.height], np.float64)
        for index, (name, _) in enumerate(self.write_images(folder, entry, scene)):
            boxes = scene.victim_pixels[index][scene.victim_area[index] >= self.min_area]
            middle, extent = (boxes[:, :2] + boxes[:, 2:]) / 2 / size, (boxes[:, 2:] - boxes[:, :2]) / size
            lines = [
                f"0 {x:.6f} {y:.6f} {w:.6f} {h:.6f}\n"
                for (x, y), (w, h) in zip(middle.tolist(), extent.tolist(), strict=True)
            ]
            (labels / f"{name}.txt").write_text("".join(lines))

    def finish(self, folder: Path, dataset: Dataset) -> None:
        """Write data.yaml with the splits and the only class; without val scenes, move some train frames to val."""
        present = {entry.split for entry in dataset.entries}
        if "val" not in present and self._hold_out(folder, dataset):
            _log.warning(
                "the val split has no scenes, so the last fifth of each train scene's frames was moved to it"
            )
            present.add("val")
        lines = [f"{split}: images/{split}" for split in SPLITS if split in present]
        (folder / "data.yaml").write_text("\n".join([*lines, "names:", "  0: victim"]) + "\n")

    def _hold_out(self, folder: Path, dataset: Dataset) -> bool:
        """Move the last fifth of each scene's frames from train to val; return whether any frame was moved.

        The moved frames are consecutive, because neighbouring frames look alike.
        """
        moved = False
        for entry in dataset.entries:
            images = sorted((folder / "images" / "train").glob(f"{entry.index:05d}_*.jpg"))
            for image in images[len(images) - max(len(images) // 5, 1) :] if images[1:] else []:
                for path in (image, folder / "labels" / "train" / f"{image.stem}.txt"):
                    place = path.parents[1] / "val"
                    place.mkdir(exist_ok=True)
                    path.rename(place / path.name)
                    moved = True
        return moved
