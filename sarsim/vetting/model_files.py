"""Checks of the files of an untrusted model, as plain XML and by size, before anything expands or opens them."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from defusedxml import DefusedXmlException, ElementTree

from pipeline.errors import InputError
from pipeline.files import MOST_TEXT, check_regular, read_bytes
from sarsim.vetting.legible import legible

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MOST_MODEL_BYTES = 100_000_000  # Total of a model's files: MJCF, meshes, textures and height fields
MOST_GEOMS = 6_000  # Including copies by ``<replicate>``; PyMJCF takes 2 ms each; esogu_52x15 has 1,600
FOLDERS = ("meshdir", "texturedir", "assetdir")
"""Attributes of ``<compiler>`` that name folders."""


class RefusedError(InputError):
    """A file that may be harmful, not merely broken or missing; nothing that refers to it is read."""


def parse_xml(path: Path, most: int = MOST_TEXT) -> "Element":
    """The root element of a file of at most ``most`` bytes.

    Raises:
        InputError: the file is missing, not a regular file, too large or not XML, or declares a document type or
            entities, which may expand endlessly or refer to other files.
    """
    content = read_bytes(path, most)
    try:
        return root_of(content)
    except DefusedXmlException as error:
        raise RefusedError(
            f"{path}: refused because it declares a document type or entities; remove the <!DOCTYPE>"
        ) from error
    except InputError:
        raise
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: cannot be parsed as XML: {' '.join(str(error).split())}") from error


def root_of(content: bytes) -> "Element":
    """The root element of XML that MuJoCo and Gazebo can read even if the standard forbids it; else ParseError."""
    try:
        return ElementTree.fromstring(content, forbid_dtd=True)
    except ElementTree.ParseError as error:
        try:
            return ElementTree.fromstring(legible(content), forbid_dtd=True)
        except ElementTree.ParseError:
            raise error from None  # The error in the original file


def parse_mjcf(path: Path) -> dict[Path, "Element"]:
    """The root elements of an MJCF file and of all MJCF files that it includes or attaches, by path.

    Raises:
        InputError: a file cannot be parsed or lies outside the folder of the first one, or the files are too large.
    """
    waiting, roots, size = [path], dict[Path, "Element"](), 0
    while waiting:
        file = waiting.pop()
        if file not in roots:
            roots[file] = parse_xml(file)
            size = _bounded(size + file.stat().st_size, path)
            names = [e.get("file", "") for e in roots[file].iter() if e.tag in ("include", "model")]
            waiting += _within(path, names, {path.parent, file.parent})
    return roots


def check_files(path: Path) -> None:
    """Check all files of a model before anything builds or opens them.

    Raises:
        InputError: as in :func:`parse_mjcf`; or the model has too many geoms, or refers to a file outside its folder
            or to something that is not a file.
    """
    roots = parse_mjcf(path)
    elements = [element for root in roots.values() for element in root.iter()]
    compilers = [element for element in elements if element.tag == "compiler"]
    folders = [e.get(name, "") for e in compilers for name in FOLDERS]
    names = {value for e in elements for name, value in e.attrib.items() if name.startswith("file")}
    bases = {base / folder for base in {file.parent for file in roots} for folder in ("", *folders)}
    size = 0
    for file in set(_within(path, names, bases)) | set(roots):
        check_regular(file)
        size = _bounded(size + file.stat().st_size, path)
    count = sum(map(_geoms, roots.values()))
    if count > MOST_GEOMS:
        raise InputError(f"{path}: has {count} geoms, including copies; the limit is {MOST_GEOMS}")


def _within(path: Path, names: Iterable[str], bases: Iterable[Path]) -> list[Path]:
    """The files with given names in folders ``bases``; InputError if one would lie outside the folder of ``path``."""
    home = path.parent.resolve()
    found = [base / name for name in names if name for base in bases]
    try:
        for file in found:
            if not file.resolve().is_relative_to(home):
                raise InputError(
                    f"{path}: refers to {file}, which is outside its folder; copy the file into that folder"
                )
        return [file for file in found if file.exists()]
    except OSError as error:  # The name is too long
        raise InputError(f"{path}: cannot find a file to which it refers: {error.strerror or error}") from error


def _bounded(size: int, path: Path) -> int:
    if size > MOST_MODEL_BYTES:
        raise InputError(
            f"{path}: the model's files are too large: at least {size} bytes in all; the limit is {MOST_MODEL_BYTES}"
        )
    return size


def _geoms(root: "Element") -> int:
    """Number of geoms in a file, including copies."""
    count, waiting = 0, [(root, 1)]
    while waiting:
        element, times = waiting.pop()
        if element.tag == "replicate":
            times *= _times(element)
        count += times * (element.tag == "geom")
        waiting += [(child, times) for child in element]
    return count


def _times(replicate: "Element") -> int:
    """Number of copies that ``<replicate>`` makes; 1 if MuJoCo would not accept its ``count``."""
    text = replicate.get("count", "")
    return int(text) if re.fullmatch("[0-9]{1,9}", text) else 1
