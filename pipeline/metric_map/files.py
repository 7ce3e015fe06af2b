"""The metric map as files: the project's own ``.npz``."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.metric_map.metric_map import MetricMap

FORMAT = "sarsim metric map"
VERSION = 1


def save_npz(path: Path | str, metric_map: MetricMap) -> None:
    """Write the map as a compressed ``.npz``, whole or not at all.

    Its entries: ``format`` (str) and ``version`` (int); ``lower`` (3,) int64, the index of the first voxel;
    ``log_odds`` (nx, ny, nz) int8; and every field of :class:`MetricMapConfig` under its own name.
    """
    lower, upper = metric_map.bounds()
    path = Path(path)
    partial = path.with_name(path.name + ".partial")
    with partial.open("wb") as file:
        np.savez_compressed(
            file,
            format=FORMAT,
            version=VERSION,
            lower=lower,
            log_odds=metric_map.log_odds(lower, upper),
            **vars(metric_map.config),
        )
    partial.replace(path)


def read_npz(path: Path | str) -> tuple[dict[str, Any], NDArray[np.int64], NDArray[np.int8]]:
    """Read what :func:`save_npz` wrote.

    Returns:
        The configuration's fields, ``lower`` and ``log_odds``.

    Raises:
        InputError: if the file is missing, damaged, foreign or of another version.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            entries = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, AttributeError) as error:
        raise InputError(f"{path}: not a readable metric map ({error})") from error
    if str(entries.pop("format", "")) != FORMAT:
        raise InputError(f"{path}: not a metric map")
    if int(entries.pop("version")) != VERSION:
        raise InputError(f"{path}: a metric map of another version than {VERSION}")
    lower, log_odds = entries.pop("lower"), entries.pop("log_odds")
    config = {name: tuple(value.tolist()) if value.ndim else value.item() for name, value in entries.items()}
    return config, lower, log_odds
