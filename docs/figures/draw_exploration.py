"""Join the pictures of the worst runs: ``draw_exploration.py FIGURES.json``."""

import json
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

WIDTH = 800  # pixels of a picture
IMAGE = Path(__file__).parents[1] / "images" / "exploration-worst.jpg"


def pictures(file: Path, worst: dict[str, list[str]]) -> NDArray[np.uint8]:
    """The images of the worst run of every group, one below the other."""
    rows = []
    for names in worst.values():
        picture = cv2.imread(str(file.with_name(f"{file.stem}-{names[0]}.png")))
        assert picture is not None
        height = round(picture.shape[0] * WIDTH / picture.shape[1])
        rows.append(cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA))
    return np.vstack(rows)


def main() -> None:
    """Draw the image."""
    file = Path(sys.argv[1])
    content = json.loads(file.read_text())
    cv2.imwrite(str(IMAGE), pictures(file, content["worst"]), [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
