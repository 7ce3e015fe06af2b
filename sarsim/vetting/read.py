"""Reads the MJCF of arenas and robots."""

from pathlib import Path

import mujoco
from dm_control import mjcf

from pipeline.errors import InputError
from sarsim.vetting.resolved import resolved
from sarsim.vetting.trial import is_shipped, vet_mjcf


def read_mjcf(path: Path) -> tuple[mujoco.MjModel, mjcf.RootElement]:
    """A compiled model, and its MJCF in a form that can be merged with another file.

    Shipped files contain no settings that would affect another file; all other files are vetted and resolved.

    Raises:
        InputError: the file is invalid; see :func:`~sarsim.vetting.trial.vet_mjcf`.
    """
    if is_shipped(path):
        return mujoco.MjModel.from_xml_path(str(path)), mjcf.from_path(str(path))
    vet_mjcf(path)
    try:
        return resolved(path)
    except InputError as error:  # It has changed since it was vetted
        raise InputError(f"{path}: {error}") from error
