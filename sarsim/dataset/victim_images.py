"""The frames of a dataset as training images for a person detector."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.labels import Label
from pipeline.victims.detection.labelled_image import TrainingImage
from sarsim.dataset.folder import Dataset
from sarsim.dataset.scene_file import Scene

MIN_AREA = 100  # Minimum visible pixels of a person to be found; people with fewer are ignored


class VictimImages(ExitStack):
    """The frames of one split, read on access."""

    def __init__(self, folders: Sequence[Path], split: str, stride: int = 1) -> None:
        """``folders``: folders of datasets; ``stride``: use every ``stride``-th frame of a scene.

        Raises:
            InputError: a folder holds no dataset, or a scene is missing or broken.
        """
        super().__init__()
        files = [
            dataset.folder / entry.file
            for dataset in map(Dataset, folders)
            for entry in dataset.entries
            if entry.split == split
        ]
        scenes = [self.enter_context(Scene(file)) for file in files]
        self._frames = [(scene, index) for scene in scenes for index in range(0, len(scene), stride)]

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: int) -> TrainingImage:
        scene, frame = self._frames[index]
        area = scene.victim_area[frame]
        seen = area > 0
        boxes = scene.victim_pixels[frame][seen].astype(np.float32)
        shown = scene.label(frame) == Label.VICTIM if seen.any() else None
        return TrainingImage(scene.rgb(frame), boxes, area[seen] < MIN_AREA, shown)

    def people(self, index: int) -> NDArray[np.floating]:
        """(N, 2) widths and heights of the people to be found in an image, as shares of the image's size."""
        scene, frame = self._frames[index]
        boxes = scene.victim_pixels[frame][scene.victim_area[frame] >= MIN_AREA]
        return (boxes[:, 2:] - boxes[:, :2]) / (scene.intrinsics.width, scene.intrinsics.height)
