"""Finds the SDF file of a model in the model's folder."""

from pathlib import Path

from pipeline.errors import InputError
from sarsim.arenas.sdf.resources import Resources, versions
from sarsim.vetting.model_files import RefusedError

CONFIG_FILES = ("model.config", "manifest.xml")
"""Files that list the SDF files of a model; the second one was used before Gazebo 1.9."""
DEFAULT_FILE = "model.sdf"
"""Name of a model's SDF file if no other is listed."""
NEWEST_VERSION = (1, 12)
"""The newest SDF version that is read."""


def model_file(resources: Resources, path: Path) -> Path:
    """The SDF file for ``path``, which is either this file itself or the folder of a model.

    The SDF file of a folder is the file of the newest supported version that ``model.config`` lists, else
    ``model.sdf``, else the only SDF file. If there is no such file, the search continues in the subfolder of the
    newest version, as in Gazebo's cache, or in the only subfolder with a model.

    Raises:
        InputError: there is no such file.
    """
    file = _file_in_folder(resources, path) if path.is_dir() else path
    if file is None:
        raise InputError(
            f"{path / DEFAULT_FILE}: no such file; add it, or a {CONFIG_FILES[0]} that names another SDF file"
        )
    return file


def _file_in_folder(resources: Resources, folder: Path) -> Path | None:
    for name in [*_listed_files(resources, folder), DEFAULT_FILE]:
        file = resources.find(name, folder, str(folder))
        if file is not None and file.is_file():
            return file
    alone = sorted(path for path in folder.iterdir() if path.suffix.lower() == ".sdf")
    if len(alone) == 1:
        return alone[0]
    newest = [folder / str(version) for version in versions(folder)]
    inner = newest or [path for path in sorted(folder.iterdir()) if path.is_dir() and _is_model(path)]
    return _file_in_folder(resources, inner[0]) if newest or len(inner) == 1 else None


def _is_model(folder: Path) -> bool:
    return any((folder / name).is_file() for name in (*CONFIG_FILES, DEFAULT_FILE))


def _listed_files(resources: Resources, folder: Path) -> list[str]:
    """The SDF files that a folder's ``model.config`` lists, newest version first."""
    config = next((folder / name for name in CONFIG_FILES if (folder / name).is_file()), None)
    try:
        listed = [] if config is None else list(resources.parse(config).iter("sdf"))
    except RefusedError:
        raise
    except InputError:
        return []  # as in Gazebo, which uses the usual file if the list is broken
    texts = [(_version(sdf.get("version", "")), (sdf.text or "").strip()) for sdf in listed]
    return [text for _, text in sorted([t for t in texts if t[1] and t[0] <= NEWEST_VERSION], reverse=True)]


def _version(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in text.split(".") if part.isdecimal())
