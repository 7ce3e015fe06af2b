"""The episodes of a sweep: one method in one arena with one seed, each a job for an engine."""

import faulthandler
import gc
import hashlib
import json
import os
import re
import signal
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.errors import InputError, one_line
from pipeline.files import atomic_write, read_text
from pipeline.rescue_report.figures import figures as flat
from sarsim.commands.sweeps.arenas import verified_checksum
from sarsim.scoring.progress import ExploredCurve
from sarsim.settings import EpisodeConfig

FOLDER = "episodes"
RUN_SPECIFIC_KEYS = re.compile(r"config\.|timing_ms\.|(wall_time_s|real_time_factor|version|arena|seed)$")
"""Pattern of the keys of a report that name settings, or figures that vary from run to run."""
MAX_NAME_LENGTH = 80  # Maximum number of characters of a method or arena in a file name
KILL_FACTOR = 1.1
"""An episode that does not end at its limit is killed with its worker after this multiple of the limit."""

CURVE_DIGITS = {"time_s": 2, "way_m": 3, "explored": 4}
"""Number of decimal places with which each field of a curve is stored."""

Row = dict[str, Any]
"""Method, arena and seed of an episode, with the arena's checksum and the figures of report.json, or ``failed``."""


class EpisodeResult(NamedTuple):
    """The data kept from an episode: its row, its explored fraction over time and distance, and processor time, s."""

    row: Row
    curve: ExploredCurve
    processor_s: float

    @classmethod
    def of_failure(cls, row: Row) -> "EpisodeResult":
        """The result of a failed episode, which is scored as if it had seen nothing."""
        return cls(row, ExploredCurve(*np.zeros((3, 1))), 0.0)


@dataclass(frozen=True)
class SweepJob:
    """One episode of a sweep.

    Attributes:
        method: name of the method, or MODULE:CLASS.
        arena: arena as in ``--arena``.
        seed: seed of all random numbers.
    """

    method: str
    arena: str
    seed: int

    @property
    def file(self) -> str:
        """Path of the episode's result in the sweep's folder."""
        parts = [re.sub(r"[^\w.-]+", "_", part)[-MAX_NAME_LENGTH:] for part in (self.method, self.arena)]
        digest = hashlib.sha256(repr(self).encode()).hexdigest()
        return f"{FOLDER}/{'-'.join(parts)}-{self.seed}-{digest[:8]}.json"

    @property
    def row(self) -> Row:
        """The part of the episode's row that is known before the episode."""
        return {"method": self.method, "arena": self.arena, "seed": self.seed}


def run_episode(settings: Mapping[str, Any], limit: float, job: SweepJob, folder: Path) -> None:
    """Run an episode, and write its result to a sweep's folder.

    ``settings``: fields of :class:`EpisodeConfig`; ``limit``: the episode's wall-clock limit, s.

    Raises:
        InputError: the method or the arena fails; the message is one line.
    """
    start = time.process_time()
    try:
        with time_limit(limit):
            figures, curve = run_and_score(job, settings)
        failure = ""
    except Exception as error:
        failure = str(error) if isinstance(error, InputError) else one_line(error)
    # The episode's maps are in reference cycles, which an error's traceback keeps alive until here.
    gc.collect()
    if failure:
        raise InputError(failure)
    kept = {"row": job.row | figures, "curve": curve_columns(curve), "processor_s": time.process_time() - start}
    path = folder / job.file
    path.parent.mkdir(exist_ok=True)
    with atomic_write(path) as part:
        part.write_text(json.dumps(kept) + "\n")


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise TimeoutError if the block takes longer than ``seconds``.

    If the block continues nevertheless, the process is ended after ``KILL_FACTOR`` times this limit.
    """

    def stop(number: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"exceeded the time limit of {seconds:g} s")

    before = signal.signal(signal.SIGALRM, stop)
    with Path(os.devnull).open("w") as nowhere:
        faulthandler.dump_traceback_later(KILL_FACTOR * seconds, exit=True, file=nowhere)
        signal.setitimer(signal.ITIMER_REAL, seconds)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
            faulthandler.cancel_dump_traceback_later()
            signal.signal(signal.SIGALRM, before)


def curve_columns(curve: ExploredCurve) -> dict[str, list[float]]:
    """The columns of a curve as stored in a file: rounded, without points at which nothing new was seen."""
    rounded = {name: np.round(getattr(curve, name), digits) for name, digits in CURVE_DIGITS.items()}
    is_new = np.diff(rounded["explored"], prepend=-1.0) > 0
    return {name: values[is_new].tolist() for name, values in rounded.items()}


def run_and_score(job: SweepJob, settings: Mapping[str, Any]) -> tuple[Row, ExploredCurve]:
    """Run an episode with ``--exploration`` set to the method, and return its row and its explored fraction."""
    from sarsim.episode import Episode  # imported here, because only the workers need it

    found = verified_checksum(job.arena)
    with tempfile.TemporaryDirectory(prefix="sarsim-") as out:
        config = EpisodeConfig(
            arena=job.arena, seed=job.seed, exploration=job.method, oracle=True, out=Path(out), **settings
        )
        episode = Episode(config)
        episode.run(show_progress=False)
        figures = {name.lstrip("."): value for name, value in flat("", episode.report)}
    kept = {key: value for key, value in figures.items() if isinstance(value, bool | int | float | str)}
    row = {"checksum": found} | {key: value for key, value in kept.items() if not RUN_SPECIFIC_KEYS.match(key)}
    return row, episode.score.progress


def result_of(job: SweepJob, folder: Path) -> EpisodeResult | None:
    """The stored result of an episode, None if it has not been run; InputError if its file is broken."""
    file = folder / job.file
    if not file.exists():
        return None
    try:
        content = json.loads(read_text(file))
        curve = ExploredCurve(*np.array([content["curve"][name] for name in CURVE_DIGITS], np.float64))
        return EpisodeResult(dict(content["row"]), curve, float(content["processor_s"]))
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{file}: not a valid episode result ({one_line(error)}); delete it to run the episode again"
        ) from error


def write_parquet(rows: Sequence[Row], path: Path) -> None:
    """Write a table with a row per episode and a column per key; a cell is empty if its episode lacks the key.

    Raises:
        InputError: the file cannot be written.
    """
    keys = dict.fromkeys(
        ("method", "arena", "seed", "checksum", "failed", *sorted({key for row in rows for key in row}))
    )
    columns = {key: [row.get(key) for row in rows] for key in keys}
    for key, values in columns.items():
        # A column of numbers gets the same type whichever episodes it holds.
        if any(isinstance(value, float) for value in values):
            columns[key] = [float(value) if isinstance(value, int) else value for value in values]
    with atomic_write(path) as part:
        pq.write_table(pa.table({key: pa.array(values) for key, values in columns.items()}), part)
