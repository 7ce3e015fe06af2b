"""The metric map's own file format: a versioned ``.npz``."""

from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import InputError
from pipeline.files import atomic_write, load_results
from pipeline.metric_map.config import MetricMapConfig
from pipeline.metric_map.metric_map import MetricMap

FORMAT = "sarsim metric map"
VERSION = 1
SETTINGS = ("voxel_size", "max_range", "offset", "hit", "miss", "margin", "max_bytes")
"""Names of the settings that are stored under their own names."""
LIMITS = {"least": "min_log_odds", "greatest": "max_log_odds"}
"""Names of the limits of the log-odds in the file, and names of the settings that hold them."""


def save_metric_map(metric_map: MetricMap, path: Path) -> None:
    """Write a map as a compressed ``.npz``, completely or not at all.

    Entries:

    - ``format`` (str) and ``version`` (int)
    - ``lower``: (3,) int64 index of the first voxel
    - ``log_odds``: (nx, ny, nz) int8
    - ``voxel_size``, ``max_range`` and ``margin`` (float, m), ``offset`` ((3,) float, voxels), ``hit``, ``miss`` and
      ``max_bytes`` (int): as in the map's configuration
    - ``greatest`` (int): the configuration's ``max_log_odds``
    - ``least`` (int): the configuration's ``min_log_odds``, which follows from the other entries

    Raises:
        InputError: the file cannot be written.
    """
    lower, upper = metric_map.bounds()
    entries: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "lower": lower,
        "log_odds": metric_map.log_odds(lower, upper),
    }
    entries |= {name: getattr(metric_map.config, name) for name in SETTINGS}
    entries |= {name: getattr(metric_map.config, limit) for name, limit in LIMITS.items()}
    with atomic_write(path) as partial, partial.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **entries)


def load_metric_map(path: Path) -> MetricMap:
    """Read a map that :func:`save_metric_map` wrote.

    Raises:
        InputError: the file is missing or damaged, is not a metric map, or has another format version.
    """
    entries = load_results(path, "metric map", "metric_map.npz", FORMAT, VERSION)
    lower, log_odds = entries.pop("lower", np.zeros(0)), entries.pop("log_odds", np.zeros(0))
    if lower.shape != (3,) or lower.dtype != np.int64 or log_odds.ndim != 3 or log_odds.dtype != np.int8:
        wrong = "the array 'lower' or 'log_odds' is missing, or has the wrong shape or type"
        raise InputError(f"{path}: {wrong}; repeat the run that wrote the file")
    settings: dict[str, Any] = {
        LIMITS.get(name, name): tuple(value.tolist()) if value.ndim else value.item()
        for name, value in entries.items()
        if name != "least"
    }
    try:
        result = MetricMap(MetricMapConfig(**settings))
    except TypeError as error:
        raise InputError(f"{path}: settings are missing or unknown; repeat the run that wrote the file") from error
    result.set_log_odds(lower, log_odds)
    return result
