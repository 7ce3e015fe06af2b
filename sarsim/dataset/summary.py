"""``index.html``: a dataset at a glance, in one file that needs no other."""

import base64
import json
from collections import Counter
from html import escape
from pathlib import Path

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
figure { margin: 0 0 1em; } figcaption { color: #555; } img { width: 32.8%; } code { white-space: pre-wrap; }
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
        "<h2>Frames</h2><p>Colour, depth (blue is near, dark red 3.5 m, black no return) and label.</p>",
        *_pictures(dataset),
        f"<h2>Recipe</h2><code>{escape(json.dumps(dataset.recipe, indent=1))}</code></html>\n",
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
    rows = [
        _row(
            label.name.lower(), f"{points[label.name.lower()]:,}", f"{points[label.name.lower()] / total:.2%}"
        )
        for label in Label
    ]
    return (
        _bar([points[label.name.lower()] / total for label in Label])
        + "<table><tr><th>label<th>points<th>share</tr>"
        + "".join(rows)
        + "</table>"
    )


def _bar(shares: list[float], width: int = 1000, height: int = 36) -> str:
    """All labels side by side, as wide as their shares."""
    boxes, x = [], 0.0
    for label, share in zip(Label, shares, strict=True):
        colour = "#" + bytes(COLOURS[label].tolist()).hex()
        title = f"<title>{label.name.lower()} {share:.1%}</title>"
        boxes.append(
            f"<rect x='{x:.1f}' width='{share * width:.1f}' height='{height}' fill='{colour}'>{title}</rect>"
        )
        x += share * width
    return f"<svg viewBox='0 0 {width} {height}' width='100%' role='img'>{''.join(boxes)}</svg>"


def _row(name: str, *values: object) -> str:
    cells = (f"<td{'' if index > 1 else ' class=number'}>{value}" for index, value in enumerate(values))
    return f"<tr><td>{escape(name)}{''.join(cells)}</tr>"


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
    pictures = (frame.rgb, depth_picture(frame.depth), COLOURS[scene.label(index)])
    caption = f"{entry.file}, look {index}: {entry.arena}, {entry.lighting}, dust {scene.settings['dust']:g}"
    return f"<figure>{''.join(map(_image, pictures))}<figcaption>{escape(caption)}</figcaption></figure>"


def depth_picture(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 RGB; near is blue, far red, no return black."""
    bgr = cv2.applyColorMap((depth / FAR * 255).clip(0, 255).astype(np.uint8), cv2.COLORMAP_TURBO)
    return np.where((depth > 0)[..., None], bgr[..., ::-1], 0).astype(np.uint8)


def _image(rgb: NDArray[np.uint8]) -> str:
    small = cv2.resize(rgb[..., ::-1], SIZE, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 85])
    return f"<img src='data:image/jpeg;base64,{base64.b64encode(data.tobytes()).decode()}' alt=''> "
