"""``index.html``: an overview of a dataset in a self-contained file."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from pipeline.html_page import jpeg, render, write_html
from pipeline.labels import COLOURS, Label
from pipeline.sensor import XTION
from sarsim.dataset.manifest import SPLITS, Dataset
from sarsim.dataset.scene_file import Scene

SUMMARY_FILE = "index.html"
MAX_PICTURED_SCENES = 12  # Maximum number of scenes of which the page shows a frame
PICTURE_SIZE = (320, 240)  # Width and height of the pictures, pixels


def write_summary(folder: Path) -> None:
    """Write the overview page into a dataset's folder.

    Raises:
        InputError: the dataset cannot be read, or the page cannot be written.
    """
    dataset = Dataset(folder)
    html = render(
        "sarsim.dataset",
        "index.html",
        name=folder.name,
        splits=list(_splits(dataset)),
        balance=list(_balance(dataset)),
        figures=list(_figures(dataset)),
        recipe=dataset.recipe,
        far=XTION.farthest,
    )
    write_html(folder / SUMMARY_FILE, html)


def _splits(dataset: Dataset) -> Iterator[dict[str, Any]]:
    """The number of scenes and frames of each split, and of scenes in each lighting."""
    for split in SPLITS:
        entries = [entry for entry in dataset.entries if entry.split == split]
        lights = Counter(entry.lighting for entry in entries)
        lighting = ", ".join(f"{count} {light}" for light, count in sorted(lights.items()))
        frames = sum(entry.frames for entry in entries)
        yield {"name": split, "scenes": len(entries), "frames": frames, "lighting": lighting}


def _balance(dataset: Dataset) -> Iterator[dict[str, Any]]:
    """The number of points with each label, their fraction, and the cumulative fraction of the preceding labels."""
    points = Counter[str]()
    for entry in dataset.entries:
        points.update(entry.points)
    total, before = max(sum(points.values()), 1), 0.0
    for label in Label:
        name, colour = label.name.lower(), "#" + bytes(COLOURS[label].tolist()).hex()
        share = points[name] / total
        yield {"name": name, "colour": colour, "points": points[name], "share": share, "before": before}
        before += share


def _figures(dataset: Dataset) -> Iterator[dict[str, Any]]:
    """For evenly spaced scenes, the images of the frame that shows the most labels."""
    step = -(-len(dataset) // MAX_PICTURED_SCENES)
    for entry in dataset.entries[:: max(step, 1)]:
        with Scene(dataset.folder / entry.file) as scene:
            index = max(range(len(scene)), key=lambda i: (len(np.unique(scene.label(i))), -i))
            frame, labels = scene.frame(index), COLOURS[scene.label(index)]
            boxes = scene.victim_pixels[index][scene.victim_area[index] > 0]
            place = f"{entry.arena}, {entry.lighting}, dust {scene.settings['dust']:g}"
        images = {"colour": with_boxes(frame.rgb, boxes), "depth": depth_picture(frame.depth), "label": labels}
        small = {
            name: np.asarray(cv2.resize(image, PICTURE_SIZE, interpolation=cv2.INTER_AREA), np.uint8)
            for name, image in images.items()
        }
        yield {
            "caption": f"{entry.file}, frame {index}: {place}",
            "pictures": {name: jpeg(image) for name, image in small.items()},
        }


def with_boxes(rgb: Rgb, boxes: NDArray[np.int32]) -> Rgb:
    """The image with (N, 4) boxes (u0, v0, u1, v1) drawn in the colour of victims."""
    picture, thickness = rgb.copy(), max(1, rgb.shape[1] // 200)
    for u0, v0, u1, v1 in boxes.tolist():
        cv2.rectangle(picture, (u0, v0), (u1 - 1, v1 - 1), COLOURS[Label.VICTIM].tolist(), thickness)
    return picture


def depth_picture(depth: NDArray[np.float32]) -> Rgb:
    """An RGB image of depths (H, W), m: near is blue, far is red, no return is black."""
    bgr = cv2.applyColorMap((depth / XTION.farthest * 255).clip(0, 255).astype(np.uint8), cv2.COLORMAP_TURBO)
    return np.where((depth > 0)[..., None], bgr[..., ::-1], 0).astype(np.uint8)
