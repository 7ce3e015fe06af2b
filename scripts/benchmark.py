"""Measure the simulator and the pipeline against their peers: ``benchmark.py SUBJECT [--json FILE]``."""

import importlib.metadata
import json
import os
import platform
from dataclasses import asdict
from pathlib import Path
from typing import Any

import tyro
from rich.console import Console
from rich.table import Table

from pipeline.errors import InputError
from pipeline.files import whole_file
from sarsim.scripts.benchmarks.camera import Camera
from sarsim.scripts.benchmarks.dataset import Dataset
from sarsim.scripts.benchmarks.exploration import ExplorationBenchmark
from sarsim.scripts.benchmarks.metric_map import MetricMapBenchmark
from sarsim.scripts.benchmarks.semantic import Semantic
from sarsim.scripts.benchmarks.subject import Result, Subject
from sarsim.scripts.benchmarks.victims import VictimsBenchmark
from sarsim.scripts.cli import guarded, parse

SUBJECTS: dict[str, type[Subject]] = {
    "camera": Camera,
    "dataset": Dataset,
    "exploration": ExplorationBenchmark,
    "metric-map": MetricMapBenchmark,
    "semantic": Semantic,
    "victims": VictimsBenchmark,
}


def benchmark(subject: Subject, name: str) -> None:
    """Measure, print the figures, and write them where ``subject.json`` says.

    Raises:
        InputError: the file cannot be written.
    """
    if subject.json and not subject.json.absolute().parent.is_dir():
        raise InputError(f"--json {subject.json}: there is no folder {subject.json.absolute().parent}")
    result = subject.measure()
    Console().print(result.table or table(name, result.figures))
    if subject.json:
        with whole_file(subject.json) as file:
            file.write_text(json.dumps(report(subject, name, result), indent=2, default=str) + "\n")


def report(subject: Subject, name: str, result: Result) -> dict[str, Any]:
    """The figures, and what they hold for."""
    settings = {
        key: str(v) if isinstance(v, Path) else v for key, v in asdict(subject).items() if key != "json"
    }
    return {
        "subject": name,
        "version": importlib.metadata.version("sarsim"),
        "machine": machine(),
        "config": settings,
        "figures": result.figures,
        **result.details,
    }


def machine() -> dict[str, Any]:
    """What the figures were measured on."""
    return {
        "system": platform.platform(),
        "processor": processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "packages": {
            name: importlib.metadata.version(name) for name in ("mujoco", "numba", "numpy", "torch")
        },
    }


def processor() -> str:
    """The processor's name, where the system tells."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def table(name: str, figures: dict[str, float]) -> Table:
    """The figures for a person to read."""
    result = Table("figure", title=name)
    result.add_column("value", justify="right")
    for key, value in figures.items():
        result.add_row(key, f"{value:,.4g}")
    return result


def main() -> None:
    """Entry point."""
    guarded(run)


def run() -> None:
    """Parse the command line and measure."""
    subject: Subject = parse(
        lambda: tyro.extras.subcommand_cli_from_dict(dict(SUBJECTS), description=__doc__)
    )
    benchmark(subject, next(name for name, kind in SUBJECTS.items() if type(subject) is kind))


if __name__ == "__main__":
    main()
