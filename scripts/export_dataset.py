"""Export a dataset to a layout that other tools read: ``export_dataset.py FORMAT --data DIR --out DIR``."""

import tyro
from rich.console import Console
from rich.progress import Progress, TimeElapsedColumn

from sarsim.dataset.exports.blocks import Blocks
from sarsim.dataset.exports.export import Export
from sarsim.dataset.exports.s3dis import S3dis
from sarsim.dataset.exports.tum import Tum
from sarsim.dataset.exports.yolo import Yolo
from sarsim.dataset.folder import Dataset
from sarsim.scripts.cli import guarded, parse

FORMATS: dict[str, type[Export]] = {"s3dis": S3dis, "blocks": Blocks, "tum": Tum, "yolo": Yolo}


def export_dataset(export: Export) -> None:
    """Export scene by scene and say where the result lies."""
    total = len(Dataset(export.data))
    with Progress(
        *Progress.get_default_columns(), TimeElapsedColumn(), console=Console(stderr=True)
    ) as progress:
        for _ in progress.track(export.run(), total=total, description="scenes"):
            pass
    Console().print(f"{total} scenes in {export.out}", soft_wrap=True)


def main() -> None:
    """Entry point."""
    guarded(run)


def run() -> None:
    """Parse the command line and export."""
    export_dataset(parse(lambda: tyro.extras.subcommand_cli_from_dict(dict(FORMATS), description=__doc__)))


if __name__ == "__main__":
    main()
