"""Files that are either whole or not there, and arrays in them."""

import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

MOST_BYTES = 4_000_000_000  # of the arrays in a file, unpacked


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
