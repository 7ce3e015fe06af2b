"""The files that a world refers to: found in the world's folder and in folders of models, read once, bounded."""

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import InputError
from pipeline.files import MOST_TEXT, read_bytes
from sarsim.vetting.model_files import MOST_MODEL_BYTES, RefusedError, parse_xml

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

VARIABLES = ("GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_RESOURCE_PATH")
"""Environment variables of Gazebo, classic and new, that list folders of models."""
_ONLINE = re.compile(r"https?://.*/models/([^/]+)(?:/(?:tip|\d+))?(?:/files)?(/.+)?/?")
"""The address of a model, or of a file of it, in Gazebo's online library."""


def missing(uri: str, where: str) -> InputError:
    """The error that a file or a folder is nowhere."""
    places = f"the folders of the world and of {' and '.join(VARIABLES[:2])}"
    return InputError(f"{where}: {' '.join(uri.split())[:200] or 'an empty <uri>'} is in none of {places}")


class Resources:
    """Finds and reads the files of one world.

    A ``model://`` or ``package://`` URI is looked for in the world's folder, in ``models`` there and beside it, and
    in the folders that Gazebo's own environment variables name. A path is one inside the folder of the file that
    names it. Nothing outside these folders is read, and nothing is fetched from the net: an online model is looked
    for by its name.
    """

    def __init__(self, world: Path):
        """``world``: path of its file."""
        home = world.resolve().parent
        named = [Path(text) for name in VARIABLES for text in os.environ.get(name, "").split(os.pathsep) if text]
        self._folders = [folder.resolve() for folder in (home, home / "models", home.parent / "models", *named)]
        self._package = home.parent
        self._size = 0
        self._read: dict[Path, bytes] = {}
        self._parsed: dict[Path, Element] = {}

    def find(self, uri: str, base: Path, where: str) -> Path | None:
        """The file or folder that a URI names in a file of folder ``base``; None if there is none.

        Raises:
            InputError: it is outside the folders of the world and of models.
        """
        shown = " ".join(uri.split())[:200]
        try:
            places = [(folder, (folder / name).resolve()) for folder, name in self._places(uri, base.resolve())]
            found = [path if self._is_inside(path, folder) else None for folder, path in places]
            existing = next((path for path in found if path is not None and path.exists()), None)
            if existing is None and found[:1] == [None]:
                raise RefusedError(f"{where}: refused, {shown} is outside the folders of the world and of models")
            return existing
        except InputError:
            raise
        except (OSError, ValueError) as error:  # a name that is too long, or has a zero byte
            raise InputError(f"{where}: {shown} is no name of a file") from error

    def _is_inside(self, path: Path, folder: Path) -> bool:
        return any(path.is_relative_to(allowed) for allowed in (folder, *self._folders))

    def _places(self, uri: str, base: Path) -> Iterator[tuple[Path, str]]:
        """Folders, and a path in each, where what a URI names may be."""
        scheme, apart, rest = uri.partition("://")
        if online := _ONLINE.fullmatch(uri):
            name = online[1] + (online[2] or "")
            yield from ((folder, spelt) for folder in self._folders for spelt in (name, name.replace("%20", " ")))
        elif not apart:
            yield from ((folder, uri) for folder in (base, *self._folders))
        elif scheme == "file":
            yield from ((folder, rest) for folder in (base, *self._folders))
        elif scheme in ("model", "package"):
            yield from ((folder, rest) for folder in self._folders)
            first, _, others = rest.partition("/")
            # The folder of a package, or one of models, may be named itself.
            yield from ((folder, others) for folder in (*self._folders, self._package) if folder.name == first)

    def parse(self, path: Path) -> "Element":
        """The root of an XML file; InputError if it is none, or the world's files are too large together."""
        if path not in self._parsed:
            self._parsed[path] = parse_xml(path, min(MOST_TEXT, MOST_MODEL_BYTES - self._size))
            self._size += path.stat().st_size
        return self._parsed[path]

    def read(self, path: Path) -> bytes:
        """The content of a file; InputError if it cannot be read, or the world's files are too large together."""
        if path not in self._read:
            self._read[path] = read_bytes(path, MOST_MODEL_BYTES - self._size)
            self._size += len(self._read[path])
        return self._read[path]
