"""Files that are either whole or not there, arrays in them, and a process apart to try strangers' files in."""

import os
import resource
import select
import signal
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

MOST_BYTES = 4_000_000_000  # of the arrays in a file, unpacked
GOOD = "good"  # what a process answers that found nothing wrong
MOST_SAID = 4096  # Longest answer of a process, in bytes, that a pipe takes at once


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


def load_arrays(path: Path, what: str) -> dict[str, NDArray[Any]]:
    """The arrays (of any shape and unit) in a ``.npz``, by name; ``what`` it should be is told where it is not.

    Raises:
        InputError: it is missing or damaged.
    """
    try:
        with zipfile.ZipFile(path) as packed:
            size = sum(member.file_size for member in packed.infolist())
        if size > MOST_BYTES:
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
    """What an action says in a process of its own, which does no harm where a library hangs or crashes.

    Args:
        action: tells in words.
        seconds: of processor time; a process that takes none waits for something, ten times as long.
        memory: bytes beyond what this process has.

    Returns:
        The beginning of its answer; nothing if it took more, or crashed.
    """
    reading, writing = os.pipe()
    child = os.fork()  # another way to start a process takes a second, and workers may have none of multiprocessing's
    if not child:
        try:
            _limit(seconds, memory)
            os.write(writing, action().encode()[:MOST_SAID])
        finally:
            os._exit(0)
    os.close(writing)
    try:
        answered, _, _ = select.select([reading], [], [], 10 * seconds)
        return os.read(reading, MOST_SAID).decode(errors="replace") if answered else ""
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(reading)


def _limit(seconds: int, memory: int) -> None:
    """Let this process take no more; it is of no other use afterwards, and silent."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    with suppress(OSError, ValueError):  # elsewhere than on Linux time is limited alone
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + memory, used + memory))
