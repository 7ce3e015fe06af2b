"""Write files whole or not at all, read arrays from files, and try untrusted files in a separate process."""

import os
import resource
import select
import signal
import zipfile
import zlib
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

MOST_UNPACKED = 4_000_000_000  # bytes, largest size of the arrays in a file, unpacked
GOOD = "good"  # Answer of a separate process that found nothing wrong


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Lend the path of a new file beside ``path``, which takes its place when the block ends without an error.

    Raises:
        InputError: the file cannot be written.
    """
    partial = path.with_name(path.name + ".part")
    try:
        yield partial
        partial.replace(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with suppress(OSError):
            partial.unlink()


def check_folder(path: Path, marks: Collection[str] = ("episode.rrd", "report.json")) -> None:
    """Decide whether results may go into a folder: it is new, or empty, or holds earlier results.

    Args:
        path: of the folder.
        marks: names of files, one of which all earlier results have; by default those of a run.

    Raises:
        InputError: it holds other files, or is no folder.
    """
    try:
        names = sorted(file.name for file in path.iterdir() if file.suffix != ".part") if path.exists() else []
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    if names and not set(marks) & set(names):
        raise InputError(f"{path}: not empty: it holds {names[0]}{''.join(f' and no {name}' for name in marks)}")


def make_folder(path: Path, marks: Collection[str] = ("episode.rrd", "report.json")) -> None:
    """Make a folder for results for which :func:`check_folder` holds; the later, the fewer refusals leave it empty.

    Raises:
        InputError: the check fails, or no file can be written there.
    """
    check_folder(path, marks)
    try:
        path.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=path).close()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error


def each(*actions: Callable[[], object]) -> None:
    """Run every action, whatever fails in others; then raise the first failure, the others being its consequences."""
    failures: list[Exception] = []
    for action in actions:
        try:
            action()
        except Exception as error:  # whatever fails must not cost the results that remain
            failures.append(error)
    if failures:
        raise failures[0]


def load_arrays(path: Path, what: str) -> dict[str, NDArray[Any]]:
    """The arrays (of any shape and unit) in a ``.npz``, by name; ``what`` names the kind of file in error messages.

    Raises:
        InputError: it is missing or damaged.
    """
    try:
        with zipfile.ZipFile(path) as packed:
            size = sum(member.file_size for member in packed.infolist())
        if size > MOST_UNPACKED:
            raise InputError(f"{path}: refused, a {what} that takes {size / 1e6:.0f} MB unpacked")
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, KeyError, EOFError, AttributeError, TypeError, NotImplementedError) as error:
        raise InputError(f"{path}: not a readable {what} ({error})") from error
    except (MemoryError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{path}: a damaged {what} ({error})") from error


def answer_apart(action: Callable[[], str], seconds: int, memory: int) -> str:
    """Run an action in a process of its own, so that a library that hangs or crashes does no harm.

    Args:
        action: returns its answer as text.
        seconds: limit of processor time; the wall time is limited to ten times as much, for a process may wait.
        memory: limit in bytes beyond what this process has.

    Returns:
        The first bytes of the answer, as many as a pipe takes at once; empty if a limit was exceeded, or it crashed.
    """
    reading, writing = os.pipe()
    child = os.fork()  # spawning takes a second, and multiprocessing's daemonic workers may not start processes
    if not child:
        try:
            _limit(seconds, memory)
            os.write(writing, action().encode()[: select.PIPE_BUF])
        finally:
            os._exit(0)
    os.close(writing)
    try:
        answered, _, _ = select.select([reading], [], [], 10 * seconds)
        return os.read(reading, select.PIPE_BUF).decode(errors="replace") if answered else ""
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(reading)


def _limit(seconds: int, memory: int) -> None:
    """Limit the processor time (s) and the memory (bytes) of this process for good, and silence its stderr."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    with suppress(OSError, ValueError):  # without Linux's /proc only the time is limited
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + memory, used + memory))
