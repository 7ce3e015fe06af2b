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
    """What is measured; brackets hold the default of each subject that has the setting.

    Attributes:
        subject: camera, dataset: time per frame and per scene, against mujoco.Renderer; metric-map: time and
            accuracy, against OctoMap; semantic: time of DGCNN, and accuracy of the labels; networks: size, time and
            accuracy of all five; planning: time per step on mapped floors; exploration: whole episodes, against two
            baselines; localisation: recorded drives, against KISS-ICP and Open3D; victims: precision and time of the
            detector, and whole episodes.
        json: file for the figures, the machine and the settings; by default the figures are only printed.
        frames: number of frames in all (camera 60), per scene (dataset 100, victims 12), per arena (metric-map 160,
            semantic 40, networks 24), at most per drive (localisation 3000), or of steps (planning 24); more give
            steadier figures.
        rounds: number of timed rounds (dataset 5, networks, semantic 7, victims 15); 0 skips the timing (victims).
        scenes: number of random arenas to render (dataset 4, victims 30); 0 for none (victims).
        seed: seed of arenas and drives (dataset, metric-map, networks, planning, semantic 0; victims 2026, on which
            no network was trained).
        nist: number of episodes in nist_6x4 (exploration, localisation, victims 10); fewer take less time.
        esogu: number of episodes in esogu_52x15 (exploration, victims 2, localisation 1).
        random: number of random arenas: of difficulties 0, 1 and 2, with an episode in each (exploration, victims 30,
            localisation 9), or of all four (networks 20).
        raf: folder of .raf arenas to explore or to label (exploration, localisation, networks, semantic).
        raf_frames: number of frames per .raf arena (semantic 10, networks 8, also per random arena).
        baselines: also run the baselines unless False, which saves time: two other strategies (exploration), episodes
            without a detector (victims), OctoMap without discretize (metric-map), KISS-ICP and Open3D (localisation).
        odometry: odometry of the episodes: wheels and gyro, or the true pose (exploration, victims wheel).
        kidnappings: number of times that the robot is carried elsewhere in nist_6x4 and in random:1 (localisation 0).
        lighting: light in episodes (exploration, localisation, victims normal) or frames (networks: normal and dark).
        labels: source of the points' labels in episodes (exploration, victims pointnext).
        weights: weights file of the network that labels points (exploration, semantic, victims), or folder of such
            files (networks); by default the shipped weights.
        detector: victim detector: .cfg and .weights (exploration, victims); by default the shipped one.
        workers: number of episodes at a time (exploration, localisation, victims: one per core).
        runs: folder for the result of each episode (exploration, localisation, victims: runs/benchmark-<subject>);
            episodes with a result in it are not run again. A drive (localisation) takes half a gigabyte.
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
    """Measure a subject, print the figures, and write them to --json; brackets hold each subject's default."""
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
