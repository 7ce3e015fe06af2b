"""How a training went: a table and a picture."""

import csv
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.files import whole_file
from pipeline.labels import COLOURS
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.networks.scores import Confusion

COLUMNS = ("step", "loss", "miou_four", *(f"iou.{label.name.lower()}" for label in CLASSES))
_WIDTH, _HEIGHT, _MARGIN = 720, 360, 40


@dataclass
class Curves:
    """Loss and validation, one row each time the network was validated."""

    rows: list[list[float]] = field(default_factory=list)

    def add(self, step: int, loss: float, confusion: Confusion) -> None:
        """Add a row; the loss is the mean since the row before."""
        self.rows.append([step, loss, confusion.miou_four, *confusion.iou.tolist()])

    def write(self, table: Path, picture: Path) -> None:
        """Write a CSV table and an SVG picture. InputError if that is impossible."""
        with whole_file(table) as file, file.open("w", newline="") as stream:
            csv.writer(stream).writerows([COLUMNS, *self.rows])
        with whole_file(picture) as file:
            file.write_text(self.picture())

    def picture(self) -> str:
        """SVG: the loss in black and the mean in grey, both dashed, the classes in their colours, from 0 to 1."""
        colours = ["black", "grey", *("#{:02x}{:02x}{:02x}".format(*COLOURS[label]) for label in CLASSES)]
        size = f'width="{_WIDTH + 2 * _MARGIN}" height="{_HEIGHT + 2 * _MARGIN}"'
        style = 'font-family="sans-serif" font-size="12"'
        frame = f'x="{_MARGIN}" y="{_MARGIN}" width="{_WIDTH}" height="{_HEIGHT}" fill="none" stroke="#ccc"'
        drawn = "".join(self._name(i, colour) + self._line(i, colour) for i, colour in enumerate(colours, 1))
        return f'<svg xmlns="http://www.w3.org/2000/svg" {size} {style}><rect {frame}/>{drawn}</svg>\n'

    @staticmethod
    def _name(column: int, colour: str) -> str:
        x = _MARGIN + _WIDTH * (column - 1) // (len(COLUMNS) - 1)
        return (
            f'<text x="{x}" y="{_MARGIN - 12}" fill="{colour}">{COLUMNS[column].removeprefix("iou.")}</text>'
        )

    def _line(self, column: int, colour: str) -> str:
        last = self.rows[-1][0] if self.rows else 1
        points = [
            f"{_MARGIN + _WIDTH * row[0] / last:.1f},{_MARGIN + _HEIGHT * (1 - min(row[column], 1)):.1f}"
            for row in self.rows
            if row[column] == row[column]  # not NaN: a class that does not occur
        ]
        dashes = "6 3" if column <= 2 else "none"
        return f'<polyline points="{" ".join(points)}" fill="none" stroke="{colour}" stroke-dasharray="{dashes}"/>'
