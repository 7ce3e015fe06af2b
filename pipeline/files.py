"""Write files completely or not at all, read files of limited size, and open untrusted files in another process."""

import os
import pickle
import resource
import signal
import stat
import subprocess
import sys
import threading
import time
import zipfile
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from math import ceil
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

MAX_MEMORY = 2**30  # bytes, limit of a map or of the arrays in a file; a growing map takes twice as much
MAX_TEXT_BYTES = 50_000_000  # bytes, limit of a text file; a TUM trajectory at 20 Hz needs 5 MB per hour
START_TIMEOUT = 60  # s, maximum time that a new Python process takes to start on a busy machine
NO_ERROR = "good"  # The answer of a separate process that has found no error


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Yield a temporary path next to ``path``; its file replaces ``path`` if the block ends without an error.

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


RUN_FILES = ("episode.rrd", "report.json")
"""Files of a run; a folder with either of them holds a run."""


def check_folder(path: Path, marks: Collection[str] = ()) -> None:
    """Check that results may be written to a folder, which must be new or empty, or hold results to be continued.

    A new folder must lie in a writable folder, and is not created by this function.

    Args:
        path: the folder.
        marks: file names; results with one of these files can be continued. By default, no results can be continued.

    Raises:
        InputError: the folder holds an earlier run or other files, or the path is not a folder.
    """
    try:
        names = sorted(file.name for file in path.iterdir() if file.suffix != ".part") if path.exists() else []
    except OSError as error:
        raise InputError(f"{path}: cannot be used as a folder: {error.strerror or error}") from error
    if names and not set(marks) & set(names):
        if set(RUN_FILES) & set(names):
            raise InputError(f"{path}: contains an earlier run; choose another folder or delete this one")
        without = f" but no {' or '.join(marks)}" if marks else ""
        raise InputError(f"{path}: contains {names[0]}{without}; choose a new or empty folder")
    _check_writable(path, next(folder for folder in (path, *path.absolute().parents) if folder.exists()))


def _check_writable(path: Path, folder: Path) -> None:
    """Raise InputError, with a message that names ``path``, unless files can be created in an existing folder."""
    try:
        TemporaryFile(dir=folder).close()
    except OSError as error:
        raise InputError(f"{path}: cannot be created or written to: {error.strerror or error}") from error


def make_folder(path: Path, marks: Collection[str] = ()) -> None:
    """Check and create a folder for results; call this late, so that earlier errors leave no empty folder.

    Raises:
        InputError: the check fails, or the folder is not writable.
    """
    check_folder(path, marks)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be created or written to: {error.strerror or error}") from error
    _check_writable(path, path)


def run_all(*actions: Callable[[], object]) -> None:
    """Run every action even if others fail; then raise the failure, or a flat ``ExceptionGroup`` of several."""
    failures: list[Exception] = []
    for action in actions:
        try:
            action()
        except Exception as error:  # A failure must not cost the remaining results
            failures += error.exceptions if isinstance(error, ExceptionGroup) else [error]
    if len(failures) > 1:
        raise ExceptionGroup("several actions failed", failures)
    if failures:
        raise failures[0]


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Ignore Ctrl-C in the block of the ``with`` statement; threads other than the main one never receive it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def silenced() -> Iterator[None]:
    """Discard the output of libraries to stderr, which only adds to the errors that the libraries raise or return."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def check_regular(path: Path, max_bytes: float = np.inf) -> None:
    """Raise InputError if a path is not a regular file but, for example, a folder, or if it exceeds ``max_bytes``."""
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error
    if not stat.S_ISREG(status.st_mode):
        kind = "folder" if stat.S_ISDIR(status.st_mode) else "device, pipe or socket"
        raise InputError(f"{path}: must be a regular file, not a {kind}")
    if status.st_size > max_bytes:
        raise InputError(f"{path}: the file has {status.st_size} bytes; the limit is {max_bytes:.0f} bytes")


def read_bytes(path: Path, max_bytes: float = np.inf) -> bytes:
    """The content of a regular file; InputError if it has more than ``max_bytes`` bytes or cannot be read."""
    check_regular(path, max_bytes)
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def read_text(path: Path, max_bytes: float = MAX_TEXT_BYTES) -> str:
    """The content of a UTF-8 text file; InputError if it has more than ``max_bytes`` bytes or is not UTF-8 text."""
    try:
        return read_bytes(path, max_bytes).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: must be UTF-8 text, but byte {error.start + 1} ({error.object[error.start]:#04x}) is invalid"
        ) from error


def check_hash(path: Path) -> None:
    """Raise InputError if the ``.sha256`` file next to the weights, if any, holds a different hash."""
    beside = path.with_name(f"{path.name}.sha256")
    if beside.exists():
        wanted = (read_text(beside).split() or [""])[0]
        found = sha256(read_bytes(path)).hexdigest()
        if wanted.lower() != found:
            raise InputError(
                f"{path}: the SHA-256 is {found}, which is not the one in {beside.name}; "
                f"replace the weights, or delete {beside.name} if you changed them"
            )


def read_numbers(path: Path, columns: str, finite: bool = True) -> NDArray[np.float64]:
    """(N, C) numbers, in any units, of a text file with C columns; text after # is a comment.

    Args:
        path: the text file.
        columns: names of the columns, separated by spaces.
        finite: whether non-finite numbers are an error.

    Raises:
        InputError: the file is not a regular file or is too large, or a line has the wrong number of columns or a
            non-finite number.
    """
    lines, count = read_text(path).splitlines(), len(columns.split())
    try:
        rows = np.array([words for line in lines if (words := line.partition("#")[0].split())], float)
    except ValueError:
        rows = np.zeros(0)
    if rows.shape[1:] != (count,) or (finite and not np.isfinite(rows).all()):
        for number, line in enumerate(lines, 1):
            if (words := line.partition("#")[0].split()) and not _are_numbers(words, count, finite):
                wanted = f"{count} {'finite ' if finite else ''}numbers ({columns})"
                raise InputError(f"{path}: line {number} must contain {wanted}, not {' '.join(words)[:60]!r}")
        raise InputError(f"{path}: contains no numbers; every line must contain {columns}")
    return rows


def _are_numbers(words: list[str], count: int, finite: bool) -> bool:
    try:
        return len(words) == count and (bool(np.isfinite(list(map(float, words))).all()) or not finite)
    except ValueError:
        return False


def load_arrays(path: Path, kind: str) -> dict[str, NDArray[Any]]:
    """The arrays in a ``.npz`` file, by name, of any shape and unit; ``kind`` names the kind of file in errors.

    Raises:
        InputError: the file is missing or damaged.
    """
    check_regular(path)
    try:
        with zipfile.ZipFile(path) as packed:
            size = sum(member.file_size for member in packed.infolist())
        if size > MAX_MEMORY:
            raise InputError(f"{path}: unpacks to {size / 1e6:.0f} MB; the limit is {MAX_MEMORY / 1e6:.0f} MB")
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except InputError:
        raise
    except Exception as error:  # The archive, its compression and NumPy's headers raise many exceptions
        said = " ".join(str(error).split())
        raise InputError(f"{path}: not a readable {kind} ({said}); repeat the run that wrote it") from error


def load_results(path: Path, what: str, name: str, form: str, version: int) -> dict[str, NDArray[Any]]:
    """The arrays in a ``.npz`` file of a run, by name, of any shape and unit.

    The arrays ``format`` and ``version`` are checked, and not returned.

    Args:
        path: the file.
        what, name: kind of file, and its name in a results folder, for errors.
        form, version: values that the arrays ``format`` and ``version`` must have.

    Raises:
        InputError: the file is missing or damaged, or has another format or version.
    """
    arrays = load_arrays(path, what)
    if str(arrays.pop("format", "")) != form:
        raise InputError(f"{path}: not a {what}; use {name} from a run's results folder")
    if (found := arrays.pop("version", np.array(0)).tolist()) != version:
        wrong = f"has format version {found!s:.20}, but this version of sarsim reads only version {version}"
        raise InputError(f"{path}: {wrong}; repeat the run that wrote it")
    return arrays


def run_isolated(function: Callable[..., str], *args: Any, seconds: int, memory: int) -> str:
    """Call a function in a new Python process, so that a library that hangs or crashes does no harm.

    The process is not forked, because a fork would inherit locks that threads of this process hold. Unlike processes
    of multiprocessing, the new process does not import the main module. This function therefore also works in a
    user's script without a main guard.

    Args:
        function: function that returns its answer as text; it must be importable.
        args: arguments of the function, which must be picklable.
        seconds: limit of processor time, s. The wall time is limited to ten times as much plus ``START_TIMEOUT``,
            because the process may have to wait.
        memory: limit of the additional memory that the process may use during the call, bytes.

    Returns:
        The answer; empty if a limit was exceeded or the process crashed.
    """
    command = [sys.executable, "-P", "-c", f"from {__name__} import _answer; _answer()"]
    try:
        process = subprocess.run(
            command,
            input=pickle.dumps((function, args, seconds, memory)),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
            timeout=START_TIMEOUT + 10 * seconds,
        )
    except subprocess.TimeoutExpired:
        return ""
    return process.stdout.decode(errors="replace") if process.returncode == 0 else ""


def _answer() -> None:
    """Limit the new process's processor time and memory permanently, call the function, and print its answer."""
    function, args, seconds, memory = pickle.load(sys.stdin.buffer)
    answer = os.dup(1)
    os.dup2(2, 1)  # The output of libraries is not part of the answer
    seconds += ceil(time.process_time())  # Excludes the time that the imports took
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    with suppress(OSError, ValueError):  # Without Linux's /proc, only the time is limited
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + memory, used + memory))
    os.write(answer, function(*args).encode())
    os._exit(0)
