"""Join pictures of the worst runs, print the table for exploration.md: ``draw_exploration.py FIGURES.json``."""

import json
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sarsim.scripts.benchmarks.exploration import BASELINE_ROWS, GROUPS, RATIO, ROWS

WIDTH = 800  # pixels of a picture
IMAGE = Path(__file__).parent / "images" / "exploration-worst.jpg"


def pictures(file: Path, worst: dict[str, list[str]]) -> NDArray[np.uint8]:
    """The worst run of every group, one below the other."""
    rows = []
    for names in worst.values():
        picture = cv2.imread(str(file.with_name(f"{file.stem}-{names[0]}.png")))
        assert picture is not None
        height = round(picture.shape[0] * WIDTH / picture.shape[1])
        rows.append(cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA))
    return np.vstack(rows)


def table(content: dict[str, Any]) -> str:
    """Markdown, a column for each group."""
    figures = content["figures"]
    groups = [group for group in GROUPS if f"{group}.runs" in figures]
    lines = [("", *groups), ("---",) * (1 + len(groups))]
    for strategy in ("", *(f"{name}." for name in content["config"]["baselines"])):
        for row in BASELINE_ROWS if strategy else ROWS:
            name = f"{strategy[:-1].replace('_', ' ')}: {row}" if strategy else row
            lines.append((name, *(told(figures, f"{strategy}{group}.{ROWS[row]}") for group in groups)))
    lines.append(
        ("time to 90 %, over nearest", *(told(figures, f"{group}.{RATIO}.median") for group in groups))
    )
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def told(figures: dict[str, float], key: str) -> str:
    """A figure in four digits, a dash where there is none."""
    return f"{figures[key]:.4g}" if key in figures else "–"


def main() -> None:
    """Draw and print."""
    file = Path(sys.argv[1])
    content = json.loads(file.read_text())
    cv2.imwrite(str(IMAGE), pictures(file, content["worst"]), [cv2.IMWRITE_JPEG_QUALITY, 85])
    print(table(content))


if __name__ == "__main__":
    main()
