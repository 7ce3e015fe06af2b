"""Run exploration methods on the same arenas with the same seeds, and compare them."""

import importlib.metadata
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.table import Column, Table
from tyro.conf import Fixed

from pipeline.errors import InputError
from pipeline.files import atomic_write, make_folder, read_bytes, read_text
from sarsim.commands.cli import progress
from sarsim.commands.provenance import CODE, ROOT, processor, state_of_code
from sarsim.commands.settings import run_with_settings, save_settings
from sarsim.commands.sweeps.arenas import arenas_of, check_names, checksum
from sarsim.flags import Given
from sarsim.jobs import FolderLock, locked, make_engine
from sarsim.methods.names import OWN_CLASS, load_own
from sarsim.opengl import check_rendering, without_opengl
from sarsim.robots.names import ROBOTS
from sarsim.settings import (
    CAMERA_SIZE,
    DEFAULT_DETECTOR,
    DEFAULT_NETWORK,
    METHODS,
    CameraSize,
    DetectorFiles,
    LabelSource,
    LightingName,
    RobotName,
    check_camera_size,
    is_own_arena,
)

if TYPE_CHECKING:
    from sarsim.commands.sweeps.episodes import EpisodeResult, SweepJob
    from sarsim.commands.sweeps.leaderboard import Entry

MANIFEST = "sweep.json"
"""File that records the version, code, settings and users' files with which a folder's episodes were run."""
ENTRIES, PAGE = "entries", "sweep.html"
SUMMARY = ("method", "T_99, s", "explored, mean over time", "people found", "failed")
"""Columns of a leaderboard's table that are printed; the others would not fit, and appear only on the page."""
EPISODE_FIELDS = ("robot", "lighting", "steps", "labels", "detector", "camera_size")
"""Settings that a sweep passes on to its episodes."""
DIGEST_DIGITS = 12  # Hexadecimal digits of a digest in the manifest, which appear in error messages
FAILED = 1  # Exit status if every episode failed


@dataclass(frozen=True, kw_only=True)
class SweepSettings:
    """Settings of a sweep: its episodes, and the processes that run them.

    Attributes:
        methods: methods as in --exploration. By default all that sarsim ships.
        arenas: arenas as in --arena; or train, val or test, with 12 frozen arenas each.
        seeds: seeds of the episodes in each arena.
        engine: run processes on this machine (local), or tasks on the Ray cluster at RAY_ADDRESS (ray).
        workers: number of episodes to run at the same time. By default one per core.
        out: folder for the results: the episodes, a Parquet table, leaderboard entries and an HTML page.
        robot: pioneer3at, jackal, or the path of an MJCF file with the same structure.
        lighting: light in the arenas; if it is dark, the robot switches on its lamp.
        steps: maximum number of exploration steps of an episode.
        labels: source of the labels: a network, rules without learning, the simulator's truth, or MODULE:CLASS.
        detector: victim detector: .onnx, Darknet's .cfg and .weights, or a .safetensors file; --no-detector leaves
            out people.
        camera_size: size of the images in pixels.
        limit: wall-clock limit of an episode, s.
    """

    methods: Annotated[tuple[str, ...], tyro.conf.arg(help_behavior_hint="")] = ()
    arenas: tuple[str, ...] = ("nist_6x4",)
    seeds: tuple[int, ...] = (0,)
    engine: Literal["local", "ray"] = "local"
    workers: Given[int] = None
    out: Path = Path("runs/sweep")
    robot: RobotName = ROBOTS[0]
    lighting: LightingName = "normal"
    steps: int = 300
    labels: LabelSource = DEFAULT_NETWORK
    detector: DetectorFiles = DEFAULT_DETECTOR
    camera_size: CameraSize = CAMERA_SIZE
    limit: Fixed[float] = 14400.0

    @property
    def episode_settings(self) -> dict[str, Any]:
        """The settings of every episode, as fields of :class:`sarsim.settings.EpisodeConfig`."""
        return {name: getattr(self, name) for name in EPISODE_FIELDS}


def sweep(settings: SweepSettings) -> None:
    """Run exploration methods on the same arenas and seeds, and compare them.

    Finished episodes are not repeated.
    """
    if not settings.seeds:
        raise InputError("--seeds: give at least one seed")
    if min(settings.seeds) < 0:
        raise InputError(f"--seeds {' '.join(map(str, settings.seeds))}: must not be negative")
    if settings.limit <= 0:
        raise InputError(f"limit {settings.limit:g}: must be positive")
    for flag, number in (("--steps", settings.steps), ("--workers", settings.workers)):
        if number is not None and number < 1:
            raise InputError(f"{flag} {number}: must be at least 1")
    check_camera_size(settings.camera_size)
    check_names(settings.methods, settings.arenas)
    from sarsim.commands.sweeps.episodes import FOLDER, SweepJob, write_parquet
    from sarsim.commands.sweeps.leaderboard import entry_of, write_entry
    from sarsim.commands.sweeps.page import write_page

    arenas, methods = arenas_of(settings.arenas), dict.fromkeys(settings.methods or METHODS["exploration"])
    files = files_of(settings, methods)
    if settings.engine == "local":
        check_rendering()
    # run the episodes that have no result in the folder yet
    jobs = [SweepJob(m, arena, seed) for arena in arenas for seed in dict.fromkeys(settings.seeds) for m in methods]
    make_folder(settings.out, [MANIFEST])
    with locked(settings.out) as lock:
        commit = update_manifest(settings, files)
        (settings.out / FOLDER).mkdir(exist_ok=True)
        check_arenas(jobs, settings.out)
        failed = run_missing(jobs, settings, lock)
        results = results_of(jobs, settings.out, failed)
        write_parquet([result.row for result in results], settings.out / "episodes.parquet")
        save_settings(settings, settings.out / "config.yaml")
    # compare the methods
    of_methods = {method: [found for found in results if found.row["method"] == method] for method in methods}
    entries = []
    for method, found in of_methods.items():
        entry = entry_of(
            [one.row for one in found],
            method=method,
            arenas=settings.arenas,
            seeds=tuple(dict.fromkeys(settings.seeds)),
            commit=commit,
            version=importlib.metadata.version("sarsim"),
            processor=processor(),
            processor_s=round(sum(one.processor_s for one in found), 1),
        )
        write_entry(entry, settings.out / ENTRIES)
        entries.append(entry)
    write_page(entries, {m: [one.curve for one in found] for m, found in of_methods.items()}, settings.out / PAGE)
    show(settings, entries, failed)
    if len(failed) == len(jobs):
        raise SystemExit(FAILED)


def files_of(settings: SweepSettings, methods: Iterable[str]) -> dict[str, Path]:
    """The files that define the user's own classes, robot and detector, by the name that the settings use.

    Raises:
        InputError: there is no such class.
    """
    own = {**dict.fromkeys(methods, "methods"), settings.labels: "labels"}
    with without_opengl():
        classes = {name: load_own(flag, name, OWN_CLASS) for name, flag in own.items() if ":" in name}
    modules = {name: sys.modules.get(getattr(found, "__module__", "")) for name, found in classes.items()}
    files = {name: getattr(module, "__file__", None) for name, module in modules.items()}
    files |= {str(path): path for path in (settings.robot, *(settings.detector or ()))}
    return {name: Path(file) for name, file in files.items() if file is not None and Path(file).is_file()}


def update_manifest(settings: SweepSettings, files: Mapping[str, Path]) -> str:
    """Write the folder's manifest or, if it exists, check it against this sweep and add the digests of new files.

    ``files``: see :func:`files_of`.

    Returns:
        The state of the code; empty outside a git checkout.

    Raises:
        InputError: the folder holds results of another state of the code or of ``files``, or of other settings.
    """
    try:
        code = state_of_code()
    except InputError:  # not a git checkout
        code = ""
    file = settings.out / MANIFEST
    current = {"version": importlib.metadata.version("sarsim"), "code": code}
    if code.endswith("+"):
        changes = subprocess.run(["git", "diff", "HEAD", "--", *CODE], cwd=ROOT, check=True, capture_output=True)
        current["digest of uncommitted changes"] = _digest(changes.stdout)
    for name, value in settings.episode_settings.items():
        current[name] = " ".join(map(str, value)) if isinstance(value, tuple) else str(value)
    digests = {f"digest of {name}": _digest(read_bytes(path)) for name, path in files.items()}
    try:
        earlier = dict(json.loads(read_text(file))) if file.exists() else current
    except (ValueError, TypeError) as error:
        raise InputError(
            f"{file}: not the {MANIFEST} of a sweep: {error}; choose another folder for --out"
        ) from error
    for key, value in (current | digests).items():
        if earlier.get(key, digests.get(key)) != value:  # A method's file is unknown until the method is first run
            raise InputError(
                f"--out {settings.out}: contains results with {key} = {earlier.get(key) or 'unknown'}, but this sweep"
                f" has {key} = {value or 'unknown'}; choose another folder"
            )
    with atomic_write(file) as part:
        part.write_text(json.dumps(earlier | digests) + "\n")
    return code


def _digest(content: bytes) -> str:
    return sha256(content).hexdigest()[:DIGEST_DIGITS]


def check_arenas(jobs: Iterable["SweepJob"], folder: Path) -> None:
    """Raise InputError if the folder holds results in an arena that has changed since.

    Only the user's own arenas are checked, because the others depend on nothing but the code.
    """
    from sarsim.commands.sweeps.episodes import result_of

    found = {job.arena: result.row.get("checksum") for job in jobs if (result := result_of(job, folder))}
    with without_opengl():
        for arena, earlier in found.items():
            if (is_own_arena(arena) or Path(arena).exists()) and checksum(arena) != earlier:
                raise InputError(
                    f"--out {folder}: contains results in {arena}, which has changed since; choose another folder"
                )


def run_missing(jobs: Sequence["SweepJob"], settings: SweepSettings, lock: FolderLock) -> dict["SweepJob", str]:
    """Run the episodes that have no result in the locked folder, and return the errors of the failed episodes."""
    from sarsim.commands.sweeps.episodes import result_of, run_episode

    todo = [job for job in jobs if result_of(job, lock.folder) is None]
    failed: dict[SweepJob, str] = {}
    work = partial(run_episode, settings.episode_settings, settings.limit)
    engine = make_engine(settings.engine, settings.workers)
    with progress() as bars, closing(engine(work, todo, lock)) as outcomes:
        bar = bars.add_task("episodes", total=len(todo))
        for job, _, error in outcomes:
            if error is not None:
                failed[job] = " ".join(str(error).split())
            bars.advance(bar)
    return failed


def results_of(jobs: Sequence["SweepJob"], folder: Path, failed: dict["SweepJob", str]) -> list["EpisodeResult"]:
    """The results of all episodes; failed episodes get the arena's checksum from the rows of other episodes."""
    from sarsim.commands.sweeps.episodes import EpisodeResult, result_of

    found = [
        result_of(job, folder) or EpisodeResult.of_failure(job.row | {"failed": failed.get(job, "not run")})
        for job in jobs
    ]
    known = {one.row["arena"]: {"checksum": one.row["checksum"]} for one in found if "checksum" in one.row}
    return [one._replace(row=known.get(one.row["arena"], {}) | one.row) for one in found]


def show(settings: SweepSettings, entries: Sequence["Entry"], failed: dict["SweepJob", str]) -> None:
    """Print the tables' main columns, and a line on stderr for each error with which a method's episodes failed."""
    from sarsim.commands.sweeps.leaderboard import boards

    for (method, error), count in Counter((job.method, text) for job, text in failed.items()).items():
        print(f"{method}: {count} of its episodes failed: {error}", file=sys.stderr)
    console = Console(markup=False)
    for board in boards(entries):
        shown = [n for n, head in enumerate(board.headings) if head in SUMMARY]
        columns = [Column(board.headings[n], overflow="fold", no_wrap=n == 0) for n in shown]
        table = Table(*columns, title=board.title, caption="interquartile means, with 95% confidence intervals")
        for row in board.rows:
            table.add_row(*(row[n] for n in shown))
        console.print(table)
    places = [settings.out / name for name in (PAGE, "episodes.parquet", ENTRIES)]
    console.print("Page: {}; episodes: {}; leaderboard entries: {}".format(*places), soft_wrap=True)


def main() -> None:
    """Entry point of ``sarsim-sweep``."""
    run_with_settings(sweep, SweepSettings)
