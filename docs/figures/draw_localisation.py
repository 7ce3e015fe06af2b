"""Join images of drives, and print the table for localisation.md: ``draw_localisation.py FIGURES.json``."""

import json
import sys
from pathlib import Path

import cv2
import numpy as np
from rich import box
from rich.console import Console

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # scripts/ is not installed
from scripts.benchmarks.exploration_table import rich_table
from scripts.benchmarks.localisation import sections_of

WIDTH = 800  # pixels of a picture
IMAGES = Path(__file__).parents[1] / "images"


def main() -> None:
    """Draw and print."""
    file = Path(sys.argv[1])
    content = json.loads(file.read_text())
    rows = []
    for name in content["worst"].values():
        picture = cv2.imread(str(file.with_name(f"{file.stem}-{name}.png")))
        assert picture is not None
        height = round(picture.shape[0] * WIDTH / picture.shape[1])
        rows.append(cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA))
    cv2.imwrite(str(IMAGES / "localisation.jpg"), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 85])
    table = rich_table("localisation", content["figures"], sections_of(content["figures"]))
    table.title, table.box = None, box.MARKDOWN
    Console(width=1000).print(table)


if __name__ == "__main__":
    main()
