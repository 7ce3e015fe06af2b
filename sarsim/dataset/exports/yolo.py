"""Boxes of victims in YOLO's training format."""

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sarsim.dataset.exports.export import ImageExport
from sarsim.dataset.folder import Dataset
from sarsim.dataset.manifest import SPLITS, SceneEntry
from sarsim.dataset.scene_file import Scene

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Yolo(ImageExport):
    """images/<split>/*.jpg, labels/<split>/*.txt with lines of class x y width height, and data.yaml."""

    def add(self, folder: Path, entry: SceneEntry, scene: Scene) -> None:
        """Write an image and a text file for each frame."""
        labels = folder / "labels" / entry.split
        labels.mkdir(parents=True, exist_ok=True)
        size = np.array([scene.intrinsics.width, scene.intrinsics.height], np.float64)
        for index, (name, _) in enumerate(self.images(folder, entry, scene)):
            boxes = scene.victim_pixels[index][scene.victim_area[index] >= self.min_area]
            middle, extent = (boxes[:, :2] + boxes[:, 2:]) / 2 / size, (boxes[:, 2:] - boxes[:, :2]) / size
            lines = [
                f"0 {x:.6f} {y:.6f} {w:.6f} {h:.6f}\n"
                for (x, y), (w, h) in zip(middle.tolist(), extent.tolist(), strict=True)
            ]
            (labels / f"{name}.txt").write_text("".join(lines))

    def finish(self, folder: Path, dataset: Dataset) -> None:
        """Write data.yaml with the splits and the only class; without val scenes, some frames of train become val."""
        present = {entry.split for entry in dataset.entries}
        if "val" not in present and self._hold_out(folder, dataset):
            _log.warning(
                "the val split has no scenes, so the last fifth of each train scene's frames was moved to it"
            )
            present.add("val")
        lines = [f"{split}: images/{split}" for split in SPLITS if split in present]
        (folder / "data.yaml").write_text("\n".join([*lines, "names:", "  0: victim"]) + "\n")

    def _hold_out(self, folder: Path, dataset: Dataset) -> bool:
        """Move the last fifth of each scene's frames from train to val; True if any was moved.

        They are consecutive, because neighbouring frames look alike.
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
