"""A dataset of small frames with people of many sizes."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from sarsim.dataset.manifest import Manifest, SceneEntry, scene_path, split_of
from sarsim.dataset.scene_file import NO_BOX, SceneFrame, SceneWriter
from tests.sarsim.dataset.small import RECIPE, content, frame

AREAS = ((120, 99), (0, 100), (0, 0), (4, 0))
"""Pixels that show each of two victims, frame after frame."""


def write_people_dataset(folder: Path, scenes: int = 5) -> None:
    """Scenes of four frames; the last one of five is for validation."""
    (folder / "scenes").mkdir()
    manifest = Manifest.new(RECIPE)
    for index in range(scenes):
        with SceneWriter(folder / scene_path(index), len(AREAS), content(2)) as writer:
            for number in range(len(AREAS)):
                writer.write(_frame(index, number))
        manifest.scenes[index] = SceneEntry(
            index, scene_path(index), split_of(index), "", len(AREAS), "toy", "dim", {}
        )
    manifest.write(folder)


def _frame(scene: int, number: int) -> SceneFrame:
    areas = np.array(AREAS[number], np.int32)
    # Boxes of a different size in each scene, which may exceed the image of 8 × 6 pixels.
    boxes = np.array([(1, 2, 3 + scene, 4 + number), (0, 1, 6, 3 + scene)], np.int32)
    return replace(frame(number), victim_area=areas, victim_pixels=np.where(areas[:, None] > 0, boxes, NO_BOX))
