"""Finds the files to which a world refers, in the world's folder and in folders of models, and reads each file once.

The total size of the files is limited.
"""

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

from pipeline.errors import InputError
from pipeline.files import MAX_TEXT_BYTES, read_bytes
from sarsim.vetting.model_files import MAX_MODEL_BYTES, RefusedError, parse_xml

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

PATH_VARIABLES = (
    "GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_RESOURCE_PATH",
    "GZ_FUEL_CACHE_PATH", "IGN_FUEL_CACHE_PATH",
)  # fmt: skip
"""Environment variables of classic and new Gazebo that list folders of models."""
_ONLINE = re.compile(r"https?://(.+)/models/([^/]+)(?:/(?:tip|\d+))?(?:/files)?(/.+?)?/?", re.IGNORECASE)
"""The address of a model, or of one of its files, in Gazebo's online library."""
_PACKAGE = "package.xml"
"""The file that makes a folder a ROS package."""
_MAX_SUFFIXES = 20  # Maximum number of suffixes of a path that are searched for
_PACKAGE_LEVELS = 3  # Maximum number of levels from a world's folder up to its package
_MAX_PACKAGES = 200  # Maximum number of packages next to the world's package that are searched
_SUBFOLDERS = ("models", "media/models", "Media/models")
"""Subfolders of a package, or of a folder in a variable, that Gazebo also searches."""


SEARCHED_PLACES = f"the world's folders or the folders listed in {' and '.join(PATH_VARIABLES[:2])}"
"""The places where a world's files are searched for, as text for messages."""


class MissingError(InputError):
    """Raised for a file or folder that was not found.

    Attributes:
        uri: the URI that was searched for.
    """

    def __init__(self, uri: str, where: str):
        self.uri = " ".join(uri.split())[:200] or "an empty <uri>"
        super().__init__(f"{where}: {self.uri} was not found in {SEARCHED_PLACES}")


_OUTSIDE = Path("..")
"""Stands for a path that must not be read."""


def versions(folder: Path) -> list[int]:
    """The versions of a model for which the model's folder has a subfolder, newest first."""
    return sorted(
        (int(path.name) for path in folder.iterdir() if path.name.isdecimal() and path.is_dir()), reverse=True
    )


def _ignoring_case(path: Path) -> Path | None:
    """The file or folder whose path equals ``path``, ignoring case; None if there is none."""
    if path.parent == path:
        return path
    folder = path.parent if path.parent.is_dir() else _ignoring_case(path.parent)
    if folder is None or not folder.is_dir():
        return None
    alike = sorted(entry for entry in folder.iterdir() if entry.name.casefold() == path.name.casefold())
    return alike[0] if alike else None


class Resources:
    """Finds and reads the files of one world.

    A ``model://`` or ``package://`` URI is searched for in these folders:

    - the world's folder, and the folders ``models`` inside and next to the world's folder,
    - the ROS package that contains the world, and the packages next to this package,
    - the folders that Gazebo's environment variables list,
    - the folder of the file that contains the URI, and the folders above this folder.

    A path is relative to the folder of the file that contains the path. If nothing exists there, for example because
    the path is from another machine, the suffixes of the path are searched for in the folders of models. Case is
    ignored. Nothing outside these folders is read, and nothing is downloaded. A model from Gazebo's online library is
    searched for by its name.
    """

    def __init__(self, world: Path):
        """``world``: path of the world's file."""
        home = world.resolve().parent
        named = [Path(text) for name in PATH_VARIABLES for text in os.environ.get(name, "").split(os.pathsep) if text]
        self._size = 0
        self._read: dict[Path, bytes] = {}
        self._parsed: dict[Path, Element] = {}
        self._packages = {home.parent.name: home.parent} | self._packages_around(home)
        beside = [home, home / "models", home.parent / "models"]
        around = [*self._packages.values(), *named]
        inside = [folder / name for folder in around for name in (*_SUBFOLDERS, "")]
        inside = [folder for folder in inside if folder != home.parent or (folder / _PACKAGE).is_file()]
        folders = dict.fromkeys(folder.resolve() for folder in (*beside, *inside))
        self._folders = [folder for folder in folders if folder.is_dir()]

    def _packages_around(self, home: Path) -> dict[str, Path]:
        """The package that contains a folder and the packages next to it, by name; empty if there is no package."""
        holding = (folder for folder in (home, *home.parents[:_PACKAGE_LEVELS]) if (folder / _PACKAGE).is_file())
        package = next(holding, None)
        if package is None:
            return {}
        others = sorted(file.parent for file in package.parent.glob(f"*/{_PACKAGE}"))[:_MAX_PACKAGES]
        return {self._package_name(folder): folder for folder in (*others, package)}

    def _package_name(self, folder: Path) -> str:
        try:
            name = (self.parse(folder / _PACKAGE).findtext("name") or "").strip()
        except InputError:
            name = ""
        return name or folder.name

    def find(self, uri: str, base: Path, where: str) -> Path | None:
        """The file or folder to which a URI refers; None if there is none.

        Args:
            uri: the URI.
            base: folder of the file that contains the URI.
            where: location of the URI for error messages.

        Raises:
            InputError: the path is outside the folders of the world and of models, or is not a valid file name.
        """
        shown = " ".join(uri.split())[:200]
        try:
            places = list(self._places(uri.replace("\\", "/"), base.resolve()))
            found = [self._existing(folder, name) for folder, name in places]
        except (OSError, ValueError) as error:  # the name is too long, or has a zero byte
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"{where}: {shown} is not a valid file name: {reason}") from error
        existing = next((path for path in found if path not in (None, _OUTSIDE)), None)
        if existing is None and found[:1] == [_OUTSIDE]:
            # An absolute path may be from another machine; a relative one that leaves the folders may be harmful.
            kind = InputError if Path(places[0][1]).is_absolute() else RefusedError
            raise kind(
                f"{where}: refused because {shown} is outside the folders of the world and its models; copy it there"
            )
        return existing

    def _existing(self, folder: Path, name: str) -> Path | None:
        """The entry of a folder by name, ignoring case; ``_OUTSIDE`` if it must not be read, None if missing."""
        path = (folder / name).resolve()
        if not self._is_inside(path, folder):
            return _OUTSIDE
        existing = path if path.exists() else _ignoring_case(path)
        return existing if existing is None or self._is_inside(existing.resolve(), folder) else _OUTSIDE

    def _is_inside(self, path: Path, folder: Path) -> bool:
        return any(path.is_relative_to(allowed) for allowed in (folder, *self._folders))

    def _places(self, uri: str, base: Path) -> Iterator[tuple[Path, str]]:
        """Yield the places to search for a URI: folders, each with a path relative to the folder."""
        for spelt in dict.fromkeys((uri, unquote(uri))):
            scheme, apart, rest = spelt.partition("://")
            if online := _ONLINE.fullmatch(spelt):
                yield from self._downloaded(*online.groups(default=""))
            elif not apart or scheme == "file":
                path = rest if apart else spelt
                yield from ((folder, path) for folder in (base, *self._folders))
                yield from self._suffixes(path)
            elif scheme in ("model", "package"):
                yield from self._of_model(rest, base)

    def _of_model(self, rest: str, base: Path) -> Iterator[tuple[Path, str]]:
        yield from ((folder, rest) for folder in self._folders)
        first, _, others = rest.partition("/")
        around = [folder for folder in (base, *base.parents) if self._is_inside(folder, base)]
        # The first part may name a package or a folder of models itself.
        named = [folder for folder in (*self._folders, *around) if folder.name == first]
        named += [folder for name, folder in self._packages.items() if name == first]
        yield from ((folder, others) for folder in named)
        yield from ((folder, rest) for folder in around)
        if others:  # in case the model's folder was renamed
            yield base, others

    def _downloaded(self, place: str, name: str, file: str) -> Iterator[tuple[Path, str]]:
        """Yield possible places of an online model or of one of its files: as in Gazebo's cache, or only by name."""
        server, *_, owner = place.split("/")
        for folder in self._folders:
            for kept in (name, f"{server}/{owner}/models/{name}"):
                yield folder, kept + file
                model = self._existing(folder, kept) if file else None
                if model and model.is_dir():
                    yield from ((model, str(version) + file) for version in versions(model))

    def _suffixes(self, path: str) -> Iterator[tuple[Path, str]]:
        """Yield the suffixes of a path, each with at least a folder and a file name, in all folders of models."""
        parts = [part for part in Path(path).parts if part != "/"]
        for start in range(0 if ".." in parts else min(len(parts) - 1, _MAX_SUFFIXES)):
            yield from ((folder, "/".join(parts[start:])) for folder in self._folders)

    def parse(self, path: Path) -> "Element":
        """The root of an XML file; InputError if the file is invalid, or the world's files are too large in total."""
        if path not in self._parsed:
            self._parsed[path] = parse_xml(path, min(MAX_TEXT_BYTES, MAX_MODEL_BYTES - self._size))
            self._size += path.stat().st_size
        return self._parsed[path]

    def read(self, path: Path) -> bytes:
        """The content of a file; InputError if it cannot be read, or the world's files are too large in total."""
        if path not in self._read:
            self._read[path] = read_bytes(path, MAX_MODEL_BYTES - self._size)
            self._size += len(self._read[path])
        return self._read[path]
