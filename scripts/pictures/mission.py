"""Draw the picture for missions.md: the files that a mission submitted.

The picture shows the 2D map, the 3D map from above in its own colours, and the list of finds.
"""

import csv
from pathlib import Path

import numpy as np
from PIL import Image

from pipeline.arrays import Rgb
from pipeline.lettering import write
from pipeline.plugins.league.cloud import RGB, read_cloud
from scripts.pictures.layout import INK, beside, blank, save, scaled, stacked

HEIGHT = 720
"""Height of the maps, pixels."""
LINE_HEIGHT = 26
"""Height of a line of the list, pixels."""


def plan_picture(path: Path) -> Rgb:
    """(HEIGHT, W, 3) image of the 2D map."""
    with Image.open(path) as picture:
        image = np.asarray(picture.convert("RGB"))
        return scaled(image, HEIGHT / len(image))


def cloud_picture(path: Path) -> Rgb:
    """(HEIGHT, W, 3) image of the 3D map from above, y up as on the 2D map, with the highest points on top."""
    cloud = read_cloud(path)
    points, colours = cloud.rows(), cloud.rows(RGB).astype(np.uint8)
    order = np.argsort(points[:, 2])
    x, y = points[order, :2].T
    scale = (HEIGHT - 20) / np.ptp(y)
    row, column = ((y.max() - y) * scale).astype(int) + 8, ((x - x.min()) * scale).astype(int) + 8
    picture = blank(int(column.max()) + 20, HEIGHT)
    for shift in np.ndindex(4, 4):
        picture[row + shift[0], column + shift[1]] = colours[order]
    return picture


def list_picture(path: Path, width: int) -> Rgb:
    """(H, width, 3) image of the list of finds, without robot and mode, which are the same in every line."""
    rows = [row[:-2] for row in csv.reader(path.read_text().splitlines()) if len(row) > 1]
    picture = blank(width, LINE_HEIGHT * (len(rows) + 1))
    for k, row in enumerate(rows, start=1):
        for column, text in enumerate(row):
            place = (10 + column * width // len(row), k * LINE_HEIGHT)
            write(picture, place, text, 17, INK)
    return picture


def draw(folder: Path) -> None:
    """Draw the files that the mission in a folder submitted."""
    plan, cloud, finds = (next((folder / "handed_in").glob(f"*{end}")) for end in (".tiff", ".ply", ".csv"))
    maps = beside(plan_picture(plan), cloud_picture(cloud))
    save("mission.jpg", stacked(maps, list_picture(finds, maps.shape[1]), gap=0), 82)
