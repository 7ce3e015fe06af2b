"""Open the recording of an episode in the Rerun viewer: ``view.py PATH [--web]``."""

import signal
import sys
from pathlib import Path
from typing import Annotated

import tyro

from pipeline.errors import InputError
from pipeline.files import check_regular
from sarsim.commands.cli import TERMINATION_SIGNALS, run

RECORDING = "episode.rrd"
MAGIC = b"RRF2"  # The first bytes of every recording


def view(path: Annotated[Path, tyro.conf.Positional], web: bool = False) -> None:
    """Open a recording in a window, or in the browser if there is no display.

    The browser page is served to this machine only, until Ctrl-C.

    Args:
        path: .rrd file, or the folder of an episode.
        web: use the browser even if there is a display.
    """
    recording = find_recording(path)
    # The page ends with this process, even if the signal arrives while the viewer starts.
    for ending in TERMINATION_SIGNALS:
        signal.signal(ending, leave)
    from pipeline.rerun.viewer import Viewer, has_display

    viewer = Viewer("web" if web or not has_display() else "spawn", recording)
    viewer.wait()


def leave(*_: object) -> None:
    """End the process; further signals are ignored, because Python's shutdown must not be interrupted."""
    for ending in TERMINATION_SIGNALS:
        signal.signal(ending, signal.SIG_IGN)
    sys.exit()


def find_recording(path: Path) -> Path:
    """The recording that ``path`` names; InputError if there is none, or the file is not a recording."""
    recording = path / RECORDING if path.is_dir() else path
    check_regular(recording)
    with recording.open("rb") as file:
        magic = file.read(len(MAGIC))
    if magic != MAGIC:
        raise InputError(f"{recording}: not a Rerun recording; give an .rrd file or the folder of an episode")
    return recording


def main() -> None:
    """Entry point of ``sarsim-view``."""
    run(view)
