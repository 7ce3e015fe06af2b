"""Measure the simulator and the pipeline against their peers: ``benchmark.py SUBJECT [--json FILE]``."""

import importlib.metadata
import inspect
import json
import os
import platform
import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.table import Table

from pipeline.files import whole_file
from sarsim.scripts.cli import call_with, check_folder_of
from sarsim.scripts.settings import run_with_settings, save_settings
from sarsim.settings import Labels, LightingName, Odometry

if TYPE_CHECKING:
    from sarsim.scripts.benchmarks.common import Result


@dataclass(frozen=True)
class Benchmark:
    """What is measured; where no value is given, the subject's own default holds, named here in brackets.

    Attributes:
        subject: camera, dataset: time of a frame and of a scene beside mujoco.Renderer; metric-map: time and accuracy
            beside OctoMap; semantic: DGCNN's time, and accuracy of the labels; networks: size, time and
            accuracy of all five; planning: time of a step on mapped floors; exploration: whole episodes beside two
            baselines; localisation: recorded drives beside KISS-ICP and Open3D; victims: precision and time of the
            detector, and whole episodes.
        json: file for the figures, with the machine and the settings that they hold for.
        frames: frames in all (camera 60), of a scene (dataset 100, victims 12), of an arena (metric-map 160,
            semantic 40, networks 24), or at most of a drive (localisation 3000), or steps (planning 24); more make
            figures steadier.
        rounds: rounds that are timed (dataset 5, networks, semantic 7, victims 15); 0 times nothing (victims).
        scenes: random arenas that are rendered (dataset 4, victims 30); 0 for none (victims).
        seed: of arenas and drives (dataset, metric-map, networks, planning, semantic 0; victims 2026, never trained
            on).
        nist: episodes in nist_6x4 (exploration, localisation, victims 10); fewer are done earlier and say less.
        esogu: episodes in esogu_52x15 (exploration, victims 2, localisation 1).
        random: episodes in random arenas of difficulties 0, 1 and 2 (exploration, victims 30, localisation 9), or
            random arenas of all four (networks 20).
        raf: folder of .raf arenas to explore or to label (exploration, localisation, networks, semantic).
        raf_frames: frames of each .raf arena (semantic 10, networks 8, of random ones too).
        baselines: also run what is compared with: two other strategies (exploration), episodes without a detector
            (victims), OctoMap without discretize (metric-map), the peers (localisation); without them it is done
            earlier.
        odometry: of the episodes, the true pose or wheels and gyro (exploration, victims truth).
        kidnappings: times that a robot is carried elsewhere in its map (localisation 0), in nist_6x4 and in random:1.
        lighting: of the episodes (exploration, localisation, victims normal) or frames (networks: normal and dark).
        labels: what labels the points in episodes (exploration, victims dgcnn).
        weights: of the network that labels (exploration, semantic, victims), or their folder (networks); by default
            the shipped ones.
        detector: of victims: .cfg and .weights (exploration, victims); by default the shipped one.
        workers: episodes at a time (exploration, localisation, victims: one a core).
        runs: folder for the result of each episode (exploration, localisation, victims: runs/benchmark-<subject>);
            those that are there already are not run again. A drive (localisation) takes half a gigabyte.
    """

    subject: Annotated[
        Literal[
            "camera",
            "dataset",
            "exploration",
            "localisation",
            "metric-map",
            "networks",
            "planning",
            "semantic",
            "victims",
        ],
        tyro.conf.Positional,
    ]
    json: Path | None = None
    frames: int | None = None
    rounds: int | None = None
    scenes: int | None = None
    seed: int | None = None
    nist: int | None = None
    esogu: int | None = None
    random: int | None = None
    raf: Path | None = None
    raf_frames: int | None = None
    baselines: bool | None = None
    odometry: Odometry | None = None
    kidnappings: int | None = None
    lighting: LightingName | None = None
    labels: Labels | None = None
    weights: Path | None = None
    detector: tuple[Path, Path] | None = None
    workers: int | None = None
    runs: Path | None = None


def benchmark(settings: Benchmark) -> None:
    """Measure a subject, print the figures, and write them where --json says."""
    if settings.json:
        check_folder_of("json", settings.json)
    measure = import_module(f"sarsim.scripts.benchmarks.{settings.subject.replace('-', '_')}").measure
    given = {name: value for name, value in asdict(settings).items() if name not in ("subject", "json")}
    result = call_with(measure, given, settings.subject)
    Console().print(result.table or table(settings.subject, result.figures))
    if settings.json:
        content = report(settings.subject, arguments(measure, given), result)
        write(settings.json, content, result.pictures)
        save_settings(settings, settings.json.with_suffix(".yaml"))


def arguments(function: Callable[..., object], given: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments of a function call: its defaults, and the given values that are not None."""
    defaults = {name: parameter.default for name, parameter in inspect.signature(function).parameters.items()}
    values = defaults | {name: value for name, value in given.items() if value is not None}
    return {name: str(value) if isinstance(value, Path) else value for name, value in values.items()}


def report(subject: str, config: Mapping[str, Any], result: "Result") -> dict[str, Any]:
    """The figures, with the version, the machine and the settings for which they hold."""
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
    run_with_settings(benchmark, Benchmark)


if __name__ == "__main__":
    main()
