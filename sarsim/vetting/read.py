"""Reads the MJCF of arenas and robots."""

from pathlib import Path

import mujoco
from dm_control import mjcf

from pipeline.errors import InputError
from sarsim.vetting.resolved import resolved
from sarsim.vetting.trial import is_shipped, vet_mjcf


def read_mjcf(path: Path) -> tuple[mujoco.MjModel, mjcf.RootElement]:
    """A model as MuJoCo compiles it, and its MJCF, with which another file can be joined.

    The files that sarsim ships set nothing that another one could misread; a stranger's is vetted and resolved.

    Raises:
        InputError: the file is invalid; see :func:`~sarsim.vetting.trial.vet_mjcf`.
    """
    if is_shipped(path):
        return mujoco.MjModel.from_xml_path(str(path)), mjcf.from_path(str(path))
    vet_mjcf(path)
    try:
        return resolved(path)
    except InputError as error:  # it has changed since
        raise InputError(f"{path}: {error}") from error
