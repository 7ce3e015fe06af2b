"""Export a dataset to a layout that other tools read: ``export_dataset.py FORMAT --data DIR --out DIR``."""

import inspect
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console

from pipeline.errors import InputError
from sarsim.commands.cli import progress, run
from sarsim.flags import Given
from sarsim.methods.plugins import find, load_object

EXPORTS = {
    "s3dis": "points:S3dis",
    "blocks": "points:Blocks",
    "tum": "tum:Tum",
    "yolo": "images:Yolo",
    "coco": "images:Coco",
}
"""Module and class of each format, in :mod:`sarsim.dataset.exports`."""


@dataclass(frozen=True)
class ExportDatasetConfig:
    """The dataset to export, the format, and the options of the formats.

    Attributes:
        format: s3dis: folders of rooms and annotated objects; blocks: HDF5 files for training point networks; tum:
            RGB-D sequences for SLAM tools; yolo: images with bounding boxes; coco: images with bounding boxes and
            masks; or a plug-in's, such as mcap: ROS 2 bags.
        data: folder of the dataset.
        out: new folder for the export; it appears once the export is complete.
        voxel: s3dis: side of the cubes that keep one point each, m; larger cubes make smaller files. By default 0.02.
        points: blocks: points per block, as the network expects them. By default 4096.
        colours: blocks: nine channels with r g b, as in S3DIS, instead of six.
        min_area: yolo, coco: minimum number of visible pixels for an object to get a box. By default 100.
    """

    format: Annotated[Literal["s3dis", "blocks", "tum", "yolo", "coco"] | str, tyro.conf.Positional]
    data: Path
    out: Path
    voxel: Given[float] = None
    points: Given[int] = None
    colours: bool = False
    min_area: Given[int] = None


def export_dataset(settings: Annotated[ExportDatasetConfig, tyro.conf.arg(name="")]) -> None:
    """Export a dataset scene by scene, and print the folder of the result."""
    from sarsim.dataset.manifest import Dataset

    if settings.format in EXPORTS:
        module, _, name = EXPORTS[settings.format].partition(":")
        kind = getattr(import_module(f"sarsim.dataset.exports.{module}"), name)
    else:
        kind = load_object(find(settings.format, ["sarsim.export"]))
    options = {name: value for name, value in asdict(settings).items() if name != "format"}
    given = {name: value for name, value in options.items() if value is not None and value is not False}
    known = inspect.signature(kind).parameters
    if unknown := [f"--{name.replace('_', '-')}" for name in given if name not in known]:
        raise InputError(f"{', '.join(unknown)}: not supported by {settings.format}")
    export = kind(**given)
    total = len(Dataset(export.data))
    with progress() as bars:
        for _ in bars.track(export.run(), total=total, description="scenes"):
            pass
    Console(markup=False).print(f"Exported {total} scene{'s' * (total != 1)} to {export.out}", soft_wrap=True)


def main() -> None:
    """Entry point of ``sarsim-export-dataset``."""
    run(export_dataset)
