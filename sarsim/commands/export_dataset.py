"""Export a dataset to a layout that other tools read: ``export_dataset.py FORMAT --data DIR --out DIR``."""

from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console

from sarsim.commands.cli import call_with, progress, run

EXPORTS = {"s3dis": "S3dis", "blocks": "Blocks", "tum": "Tum", "yolo": "Yolo", "coco": "Coco", "mcap": "Mcap"}
"""The class of each format, in the module of :mod:`sarsim.dataset.exports` with the format's name."""


@dataclass(frozen=True)
class ExportDataset:
    """What is exported, and how.

    Attributes:
        format: s3dis: folders of rooms and annotated objects; blocks: HDF5 files to train point networks; tum: RGB-D
            sequences for SLAM tools; yolo: images with boxes of victims; coco: images with boxes and masks of victims
            and all other objects; mcap: ROS 2 bags.
        data: folder of the dataset.
        out: new folder for the export; it appears only when the export is complete.
        voxel: s3dis: side, m, of the cubes that keep one point each; larger ones make smaller files; by default 0.02.
        points: blocks: number of points in a block, as many as the network takes; by default 4096.
        colours: blocks: nine channels, with r g b, as S3DIS has, instead of six.
        min_area: yolo, coco: least number of visible pixels of an object that gets a box; by default 100.
    """

    format: Annotated[Literal["s3dis", "blocks", "tum", "yolo", "coco", "mcap"], tyro.conf.Positional]
    data: Path
    out: Path
    voxel: float | None = None
    points: int | None = None
    colours: bool = False
    min_area: int | None = None


def export_dataset(settings: Annotated[ExportDataset, tyro.conf.arg(name="")]) -> None:
    """Export a dataset scene by scene, and print the folder of the result."""
    from sarsim.dataset.folder import Dataset

    kind = getattr(import_module(f"sarsim.dataset.exports.{settings.format}"), EXPORTS[settings.format])
    given = {name: value for name, value in asdict(settings).items() if name != "format" and value is not False}
    export = call_with(kind, given, settings.format)
    total = len(Dataset(export.data))
    with progress() as bars:
        for _ in bars.track(export.run(), total=total, description="scenes"):
            pass
    Console().print(f"{total} scenes in {export.out}", soft_wrap=True)


def main() -> None:
    """Entry point."""
    run(export_dataset)
