"""Work for tests of the engines themselves: its workers import no simulator, and begin at once."""

import os
import signal
import time
from pathlib import Path

from pipeline.errors import InputError

LONG = 60.0  # s, of a job that is to be killed meanwhile, and of waiting for one


def write(job: int, folder: Path) -> str:
    """Write a file, in a folder of its own; its name."""
    path = folder / "made" / f"{job}.txt"
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"{job}\n")
    return path.name


def die_the_first_time(job: int, folder: Path) -> str:
    """Write a file, but die over the first attempt, halfway."""
    begun = folder / f"{job}.begun"
    if not begun.exists():
        begun.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return write(job, folder)


def die_at_0(job: int, folder: Path) -> str:
    """Write a file, but always die over job 0."""
    if job == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return write(job, folder)


def hold(job: tuple[int, Path], folder: Path) -> str:
    """Write a file once ``go`` is in the folder that is given with the job, where each attempt is noted."""
    number, begun = job
    with (begun / str(number)).open("a") as file:
        file.write("begun ")
    wait_for(begun / "go")
    return write(number, folder)


def wait_for(*paths: Path) -> None:
    """Wait until all of these files are there, for a minute at most."""
    end = time.monotonic() + LONG
    while not all(path.exists() for path in paths):
        assert time.monotonic() < end, paths
        time.sleep(0.01)


def fail(job: int, folder: Path) -> str:
    """Fail: by bad input, by an error that cannot be sent, or by an error of the program."""
    if job == 0:
        raise InputError("--bad: input")
    raise (Unsendable(folder, job) if job == 1 else KeyError("a bug"))


class Unsendable(Exception):  # noqa: N818 - a name of the test's own
    """An error that cannot be made again from its text."""

    def __init__(self, folder: Path, job: int):
        super().__init__(f"{folder.name} {job}")


def stay(job: int, folder: Path) -> str:
    """Stay halfway, and take some time to clean up."""
    try:
        (folder / f"{job}.begun").touch()
        time.sleep(LONG)
    finally:
        time.sleep(1)
        (folder / f"{job}.cleaned").touch()
    return ""


def refuse_to_end(job: int, folder: Path) -> str:
    """Stay halfway, whatever SIGTERM says."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    (folder / f"{job}.begun").touch()
    time.sleep(LONG)
    return ""


def threads(job: int, folder: Path) -> str:
    """The number of threads that numerical libraries may use."""
    return os.environ["OMP_NUM_THREADS"]
