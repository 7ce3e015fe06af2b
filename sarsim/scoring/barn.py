"""The rules of the BARN challenge: whether a robot has crossed a field of cylinders, and how well.

As in its program (github.com/Daffan/the-barn-challenge, run.py): Perille et al., "Benchmarking Metric Ground
Navigation" (SSRR 2020), and Xiao et al., "Autonomous Ground Navigation in Highly Constrained Spaces" (2022).
"""

from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Places, Pose
from pipeline.errors import InputError

START = (-2.25, 3.0, 90.0)
"""The start pose: x and y in m, heading in degrees."""
GOAL = (-2.25, 13.0)
"""x and y in m, 10 m ahead of the start."""
ARRIVED = 1.0  # m from the goal, within which it counts as reached
MOVED = 0.1  # m from the start, at which the clock starts
LIMIT = 100.0  # s
SPEED = 2.0  # m/s on the reference path: the Jackal's top speed, by its data sheet
BEST, WORST = 2.0, 8.0  # Multiples of the reference time, between which the score of a success falls
CELL, FIRST_CELL = (
    0.15,
    np.array([-4.575, 5.075]),
)  # Side of a cell of the reference path, and the centre of cell (0, 0), m


@dataclass
class BarnJudge:
    """Judges a run by the robot's true pose.

    Attributes:
        begin: when the robot was set down, s.
        started: when it had moved far enough for the clock to start, s; None before.
        ended: ``reached``, ``contact`` or ``time``; None before.
        seconds: time on the clock, s; 0 until it starts.
    """

    begin: float
    started: float | None = None
    ended: str | None = None
    seconds: float = 0.0

    def see(self, time: float, T_world_base: Pose, contacts: int) -> bool:
        """Judge a true pose at a time, s, and the number of contacts so far; returns whether the run may go on.

        The limit also holds for a robot that has not moved, from when it was set down.
        """
        place = T_world_base[:2, 3]
        if self.started is None and np.linalg.norm(place - START[:2]) >= MOVED:
            self.started = time
        self.seconds = 0.0 if self.started is None else time - self.started
        late = time - (self.begin if self.started is None else self.started) >= LIMIT
        arrived = bool(np.linalg.norm(place - GOAL) <= ARRIVED)
        self.ended = "contact" if contacts else "time" if late else "reached" if arrived else None
        return self.ended is None


def score(seconds: float | None, optimal: float) -> float:
    """Score of a run: from 1/8 to 1/2, or 0 without success (``seconds`` is None). ``optimal``: reference time, s."""
    return 0.0 if seconds is None else optimal / float(np.clip(seconds, BEST * optimal, WORST * optimal))


def optimal_seconds(cells: NDArray[np.float64]) -> float:
    """Time in s to drive the reference path from the start over (K, 2) cells to the goal."""
    path = np.vstack([START[:2], FIRST_CELL + CELL * cells, GOAL])
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()) / SPEED


def read_path(file: Path) -> Places:
    """(K, 2) cells of the reference path in a NumPy file; InputError if the file has none."""
    try:
        # Memory-mapped, so that a file that claims to be huge takes no memory.
        cells = np.load(file, mmap_mode="r", allow_pickle=False)
    except FileNotFoundError as error:
        raise InputError(f"{file}: no such file; each world_N.world needs a path_N.npy next to it") from error
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror or error}") from error
    except (ValueError, EOFError, BadZipFile) as error:
        raise InputError(f"{file}: not a NumPy file of numbers; copy it from the data set again") from error
    if not isinstance(cells, np.ndarray) or cells.ndim != 2 or cells.shape[1] != 2 or cells.dtype.kind not in "iuf":
        found = f"{cells.dtype} of shape {cells.shape}" if isinstance(cells, np.ndarray) else "an archive"
        raise InputError(f"{file}: a reference path must be a numeric array of shape (K, 2), not {found}")
    if not np.isfinite(cells).all():
        raise InputError(f"{file}: all values of a reference path must be finite")
    return np.array(cells, np.float64)
