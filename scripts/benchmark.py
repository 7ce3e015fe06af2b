"""Measure the simulator and the pipeline against their peers: ``benchmark.py SUBJECT [--json FILE]``."""

import importlib.metadata
import json
import os
import platform
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from pipeline.files import whole_file
from sarsim.scripts.benchmarks.settings import (
    CameraSettings,
    CorrectionSettings,
    DatasetSettings,
    ExplorationSettings,
    FindsSettings,
    LanesSettings,
    LocalisationSettings,
    MetricMapSettings,
    NetworksSettings,
    PlanningSettings,
    SemanticSettings,
    SubjectSettings,
    TasksSettings,
    VictimsSettings,
)
from sarsim.scripts.cli import check_folder_of
from sarsim.scripts.settings import run_one_of, save_settings

if TYPE_CHECKING:
    from sarsim.scripts.benchmarks.common import Result


SUBJECTS: dict[str, type[SubjectSettings]] = {
    "camera": CameraSettings,
    "correction": CorrectionSettings,
    "dataset": DatasetSettings,
    "exploration": ExplorationSettings,
    "finds": FindsSettings,
    "lanes": LanesSettings,
    "localisation": LocalisationSettings,
    "metric-map": MetricMapSettings,
    "networks": NetworksSettings,
    "planning": PlanningSettings,
    "semantic": SemanticSettings,
    "tasks": TasksSettings,
    "victims": VictimsSettings,
}


def benchmark(settings: SubjectSettings, subject: str) -> None:
    """Measure a subject, print the figures, and write them to --json."""
    if settings.json:
        check_folder_of("json", settings.json)
    result = import_module(f"sarsim.scripts.benchmarks.{subject.replace('-', '_')}").measure(settings)
    Console().print(result.table or table(subject, result.figures))
    if settings.json:
        write(settings.json, report(subject, settings, result), result.pictures)
        save_settings(settings, settings.json.with_suffix(".yaml"))


def report(subject: str, settings: SubjectSettings, result: "Result") -> dict[str, Any]:
    """The figures, with the version, the machine and the settings for which they hold."""
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
    """Write the figures, and beside them the pictures, whose names begin with the file's.

    Raises:
        InputError: they cannot be written.
    """
    with whole_file(file) as part:
        part.write_text(json.dumps(content, indent=2, default=str) + "\n")
    for picture in pictures:
        with whole_file(file.with_name(f"{file.stem}-{picture.name}")) as part:
            shutil.copyfile(picture, part)


def machine() -> dict[str, Any]:
    """The machine and the packages with which the figures were measured."""
    return {
        "system": platform.platform(),
        "processor": processor(),
        "instructions": instructions(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "packages": {name: importlib.metadata.version(name) for name in ("mujoco", "numba", "numpy", "torch")},
    }


def processor() -> str:
    """The processor's name, if the system gives it."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def instructions() -> str:
    """The widest vector instructions that numba uses: the processor's, unless NUMBA_CPU_FEATURES limits them."""
    from numba import config  # imported here, because it takes too long for --help
    from numba.core.codegen import get_host_cpu_features

    features = get_host_cpu_features() if config.CPU_FEATURES is None else config.CPU_FEATURES
    names = {"+avx512f": "AVX-512", "+avx2": "AVX2", "+avx": "AVX", "+sse2": "SSE", "+neon": "NEON"}
    return next((name for feature, name in names.items() if feature in features.split(",")), platform.machine())


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
