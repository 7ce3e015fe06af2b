"""The metric map's own file: a versioned ``.npz``."""

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.files import whole_file

FORMAT = "sarsim metric map"
VERSION = 1


def write_npz(
    path: Path, config: dict[str, Any], lower: NDArray[np.int64], log_odds: NDArray[np.int8]
) -> None:
    """Write a map as a compressed ``.npz``, whole or not at all.

    Its entries: ``format`` (str) and ``version`` (int); ``lower`` (3,) int64, the index of the first voxel;
    ``log_odds`` (nx, ny, nz) int8; and every field of the configuration under its own name.

    Raises:
        InputError: if it cannot be written.
    """
    entries: dict[str, Any] = {"format": FORMAT, "version": VERSION, "lower": lower, "log_odds": log_odds}
    with whole_file(path) as partial, partial.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **entries, **config)


def read_npz(path: Path) -> tuple[dict[str, Any], NDArray[np.int64], NDArray[np.int8]]:
    """Read what :func:`write_npz` wrote.

    Returns:
        The configuration's fields, ``lower`` and ``log_odds``.

    Raises:
        InputError: if the file is missing, damaged, foreign or of another version.
    """
    entries = _entries(path)
    if str(entries.pop("format", "")) != FORMAT:
        raise InputError(f"{path}: not a metric map")
    if entries.pop("version", np.array(0)).tolist() != VERSION:
        raise InputError(f"{path}: not of version {VERSION} of the metric map's format")
    lower, log_odds = entries.pop("lower", np.zeros(0)), entries.pop("log_odds", np.zeros(0))
    if lower.shape != (3,) or lower.dtype != np.int64 or log_odds.ndim != 3 or log_odds.dtype != np.int8:
        raise InputError(f"{path}: lower or log_odds is missing or has the wrong shape or type")
    config = {name: tuple(value.tolist()) if value.ndim else value.item() for name, value in entries.items()}
    return config, lower, log_odds


def _entries(path: Path) -> dict[str, NDArray[Any]]:
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, KeyError, EOFError, AttributeError, TypeError, NotImplementedError) as error:
        raise InputError(f"{path}: not a readable metric map ({error})") from error
    except (MemoryError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{path}: a damaged metric map ({error})") from error
