"""Draw the picture of missions.md: ``python docs/figures/draw_mission.py runs/mission``.

It shows what a mission submitted: the 2D map, the 3D map from above in its own colours, and the list of finds.
"""

import csv
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pipeline.plugins.league.cloud import RGB, read_cloud

IMAGE = Path(__file__).parents[1] / "images" / "mission.jpg"
HEIGHT = 720
"""Height of the maps, pixels."""
LINE = 26
"""Height of a line of the list, pixels."""
FONT = cv2.FONT_HERSHEY_SIMPLEX


def plan_picture(path: Path) -> NDArray[np.uint8]:
    """(HEIGHT, w, 3) BGR of the 2D map."""
    with Image.open(path) as picture:
        return as_high(np.asarray(picture.convert("RGB"))[..., ::-1])


def cloud_picture(path: Path) -> NDArray[np.uint8]:
    """(HEIGHT, w, 3) BGR of the 3D map from above, y up as on the 2D map, the highest points on top."""
    cloud = read_cloud(path)
    points, colours = cloud.points(), cloud.points(RGB).astype(np.uint8)
    order = np.argsort(points[:, 2])
    x, y = points[order, :2].T
    scale = (HEIGHT - 20) / np.ptp(y)
    row, column = ((y.max() - y) * scale).astype(int) + 8, ((x - x.min()) * scale).astype(int) + 8
    picture = np.full((HEIGHT, column.max() + 20, 3), 255, np.uint8)
    for shift in np.ndindex(4, 4):
        picture[row + shift[0], column + shift[1]] = colours[order, ::-1]
    return picture


def list_picture(path: Path, width: int) -> NDArray[np.uint8]:
    """(h, width, 3) BGR of the list of finds, as text."""
    rows = [row for row in csv.reader(path.read_text().splitlines()) if len(row) > 1]
    picture = np.full((LINE * (len(rows) + 1), width, 3), 255, np.uint8)
    for k, row in enumerate(rows, start=1):
        for column, text in enumerate(row):
            place = (10 + column * width // len(row), k * LINE)
            cv2.putText(picture, text, place, FONT, 0.55, (40, 40, 40), 1, cv2.LINE_AA)
    return picture


def as_high(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture scaled to ``HEIGHT``."""
    width = round(picture.shape[1] * HEIGHT / picture.shape[0])
    return cv2.resize(picture, (width, HEIGHT), interpolation=cv2.INTER_AREA)


def main() -> None:
    """Draw what the folder's mission submitted."""
    folder = Path(sys.argv[1]) / "handed_in"
    plan, cloud, finds = (next(folder.glob(f"*{end}")) for end in (".tiff", ".ply", ".csv"))
    maps = np.hstack([plan_picture(plan), cloud_picture(cloud)])
    cv2.imwrite(str(IMAGE), np.vstack([maps, list_picture(finds, maps.shape[1])]), [cv2.IMWRITE_JPEG_QUALITY, 82])


if __name__ == "__main__":
    main()
