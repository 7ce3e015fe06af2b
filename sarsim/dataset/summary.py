"""``index.html``: a dataset at a glance, in one file that needs no other."""

import base64
from collections import Counter
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.files import whole_file
from pipeline.labels import COLOURS, Label
from sarsim.dataset.folder import Dataset
from sarsim.dataset.manifest import SPLITS, SceneEntry
from sarsim.dataset.scene_file import Scene

FILE = "index.html"
PICTURED = 12
"""Scenes of which there is a picture at most."""
SIZE = (320, 240)
FAR = 3.5
"""m, the end of the depth pictures' colours."""

STYLE = """
body { font: 15px/1.5 sans-serif; max-width: 1060px; margin: 2em auto; padding: 0 1em; color: #222; }
table { border-collapse: collapse; } td, th { padding: .15em .9em .15em 0; text-align: left; vertical-align: top; }
td.number { text-align: right; font-variant-numeric: tabular-nums; }
figure { margin: 0 0 1em; } figcaption { color: #555; } img { width: 32.8%; }
i { padding: 0 .5em; margin-right: .5em; }
"""


def write_summary(folder: Path) -> None:
    """Write the page of a dataset's folder.

    Raises:
        InputError: the dataset cannot be read, or the page cannot be written.
    """
    dataset = Dataset(folder)
    parts = [
        f"<!doctype html><html lang='en'><meta charset='utf-8'><title>{escape(folder.name)}</title>",
        f"<style>{STYLE}</style><h1>{escape(folder.name)}</h1>",
        _contents(dataset),
        "<h2>Class balance</h2>",
        _balance(dataset),
        "<h2>Frames</h2>",
        "<p>Colour with the victims' boxes, depth (blue is near, dark red 3.5 m, black no return) and label.</p>",
        *_pictures(dataset),
        f"<h2>Recipe</h2><table>{''.join(_settings(dataset.recipe))}</table></html>\n",
    ]
    with whole_file(folder / FILE) as partial:
        partial.write_text("\n".join(parts))


def _contents(dataset: Dataset) -> str:
    """How much there is, by split and lighting."""
    rows = []
    for split in SPLITS:
        entries = [entry for entry in dataset.entries if entry.split == split]
        lights = Counter(entry.lighting for entry in entries)
        told = ", ".join(f"{count} {light}" for light, count in sorted(lights.items()))
        rows.append(_row(split, len(entries), sum(entry.frames for entry in entries), told))
    return "<table><tr><th>split<th>scenes<th>frames<th>lighting</tr>" + "".join(rows) + "</table>"


def _balance(dataset: Dataset) -> str:
    """A bar and a row for each label."""
    points = Counter[str]()
    for entry in dataset.entries:
        points.update(entry.points)
    total = max(sum(points.values()), 1)
    counts = [points[label.name.lower()] for label in Label]
    rows = [
        _row(label.name.lower(), f"{count:,}", f"{count / total:.2%}", colour=_colour(label))
        for label, count in zip(Label, counts, strict=True)
    ]
    table = "<table><tr><th>label<th>points<th>share</tr>" + "".join(rows) + "</table>"
    return _bar([count / total for count in counts]) + table


def _bar(shares: list[float], width: int = 1000, height: int = 36) -> str:
    """All labels side by side, as wide as their shares."""
    boxes, x = [], 0.0
    for label, share in zip(Label, shares, strict=True):
        title = f"<title>{label.name.lower()} {share:.1%}</title>"
        boxes.append(
            f"<rect x='{x:.1f}' width='{share * width:.1f}' height='{height}' fill='{_colour(label)}'>{title}</rect>"
        )
        x += share * width
    return f"<svg viewBox='0 0 {width} {height}' width='100%' role='img'>{''.join(boxes)}</svg>"


def _colour(label: Label) -> str:
    return "#" + bytes(COLOURS[label].tolist()).hex()


def _row(name: str, *values: object, colour: str = "") -> str:
    patch = f"<i style='background:{colour}'></i>" if colour else ""
    cells = (f"<td{'' if index > 1 else ' class=number'}>{value}" for index, value in enumerate(values))
    return f"<tr><td>{patch}{escape(name)}{''.join(cells)}</tr>"


def _settings(values: dict[str, Any], prefix: str = "") -> Iterator[str]:
    """A row for each setting of a recipe, as the command's flags name it."""
    for key, value in values.items():
        name = f"{prefix}{key.replace('_', '-')}"
        if isinstance(value, dict):
            yield from _settings(value, f"{name}.")
        else:
            words = " ".join(map(str, value if isinstance(value, list) else [value]))
            yield f"<tr><td>--{escape(name)}<td>{escape(words)}</tr>"


def _pictures(dataset: Dataset) -> list[str]:
    """The frame of some scenes that shows most labels."""
    step = -(-len(dataset) // PICTURED)
    figures = []
    for entry in dataset.entries[:: max(step, 1)]:
        with Scene(dataset.folder / entry.file) as scene:
            figures.append(_figure(entry, scene))
    return figures


def _figure(entry: SceneEntry, scene: Scene) -> str:
    index = max(range(len(scene)), key=lambda i: (len(np.unique(scene.label(i))), -i))
    frame = scene.frame(index)
    boxes = scene.victim_pixels[index][scene.victim_area[index] > 0]
    pictures = (with_boxes(frame.rgb, boxes), depth_picture(frame.depth), COLOURS[scene.label(index)])
    caption = f"{entry.file}, look {index}: {entry.arena}, {entry.lighting}, dust {scene.settings['dust']:g}"
    return f"<figure>{''.join(map(_image, pictures))}<figcaption>{escape(caption)}</figcaption></figure>"


def with_boxes(rgb: NDArray[np.uint8], boxes: NDArray[np.int32]) -> NDArray[np.uint8]:
    """(H, W, 3) the picture with (N, 4) boxes u0, v0, u1, v1 in the colour of victims."""
    picture, thickness = rgb.copy(), max(1, rgb.shape[1] // 200)
    for u0, v0, u1, v1 in boxes.tolist():
        cv2.rectangle(picture, (u0, v0), (u1 - 1, v1 - 1), COLOURS[Label.VICTIM].tolist(), thickness)
    return picture


def depth_picture(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 RGB; near is blue, far red, no return black."""
    bgr = cv2.applyColorMap((depth / FAR * 255).clip(0, 255).astype(np.uint8), cv2.COLORMAP_TURBO)
    return np.where((depth > 0)[..., None], bgr[..., ::-1], 0).astype(np.uint8)


def _image(rgb: NDArray[np.uint8]) -> str:
    small = cv2.resize(rgb[..., ::-1], SIZE, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 85])
    return f"<img src='data:image/jpeg;base64,{base64.b64encode(data.tobytes()).decode()}' alt=''> "
