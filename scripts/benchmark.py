"""Measure the simulator and the pipeline against their peers: ``benchmark.py SUBJECT [--json FILE]``."""

import importlib.metadata
import json
import shutil
import sys
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

try:
    from rich.console import Console
except ModuleNotFoundError as error:
    raise SystemExit(
        f"error: {error.name} is not installed; run: make develop && source .venv/bin/activate"
    ) from None
from rich.table import Table

from pipeline.files import atomic_write
from sarsim.commands.cli import check_folder_of
from sarsim.commands.provenance import instructions, machine, processor
from sarsim.commands.settings import run_one_of, save_settings

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # scripts/ is not installed
from scripts.benchmarks.settings import (
    BarnSettings,
    CameraSettings,
    CorrectionSettings,
    CostSettings,
    DatasetSettings,
    ExplorationSettings,
    FindsSettings,
    GoalsSettings,
    LanesSettings,
    LocalisationSettings,
    MetricMapSettings,
    NetworksSettings,
    PlanningSettings,
    SemanticSettings,
    SubjectSettings,
    TasksSettings,
    VictimsSettings,
    WorldsSettings,
)

if TYPE_CHECKING:
    from scripts.benchmarks.common import Result


SUBJECTS: dict[str, type[SubjectSettings]] = {
    "barn": BarnSettings,
    "camera": CameraSettings,
    "correction": CorrectionSettings,
    "cost": CostSettings,
    "dataset": DatasetSettings,
    "exploration": ExplorationSettings,
    "finds": FindsSettings,
    "goals": GoalsSettings,
    "lanes": LanesSettings,
    "localisation": LocalisationSettings,
    "metric-map": MetricMapSettings,
    "networks": NetworksSettings,
    "planning": PlanningSettings,
    "semantic": SemanticSettings,
    "tasks": TasksSettings,
    "victims": VictimsSettings,
    "worlds": WorldsSettings,
}


def benchmark(settings: SubjectSettings, subject: str) -> None:
    """Measure a subject, print the figures, and write them to --json."""
    if settings.json:
        check_folder_of("json", settings.json)
    result = import_module(f"scripts.benchmarks.{subject.replace('-', '_')}").measure(settings)
    Console().print(result.table or table(subject, result.figures))
    if settings.json:
        write(settings.json, report(subject, settings, result), result.pictures)
        save_settings(settings, settings.json.with_suffix(".yaml"))


def report(subject: str, settings: SubjectSettings, result: "Result") -> dict[str, Any]:
    """The figures, with the version, the machine and the settings of the measurement."""
    config = {name: value for name, value in asdict(settings).items() if name != "json"}
    return {
        "subject": subject,
        "version": importlib.metadata.version("sarsim"),
        "machine": machine(),
        "config": config,
        "figures": result.figures,
        **result.details,
    }


def write(file: Path, content: Mapping[str, Any], pictures: Iterable[Path]) -> None:
    """Write the figures and, next to them, the pictures, whose names get the file's stem as a prefix.

    Raises:
        InputError: a file cannot be written.
    """
    with atomic_write(file) as part:
        part.write_text(json.dumps(content, indent=2, default=str) + "\n")
    for picture in pictures:
        with atomic_write(file.with_name(f"{file.stem}-{picture.name}")) as part:
            shutil.copyfile(picture, part)


def table(name: str, figures: Mapping[str, float]) -> Table:
    """The figures as a table to print."""
    result = Table("figure", title=name, caption=f"{processor()}, {instructions()}")
    result.add_column("value", justify="right")
    for key, value in figures.items():
        result.add_row(key, f"{value:,.4g}")
    return result


def main() -> None:
    """Entry point."""
    run_one_of({name: (partial(benchmark, subject=name), kind) for name, kind in SUBJECTS.items()}, str(__doc__))


if __name__ == "__main__":
    main()
