"""Untrusted XML files: of bounded size, and without entities, which may expand endlessly or name other files."""

from pathlib import Path
from typing import TYPE_CHECKING

from defusedxml import DefusedXmlException, ElementTree

from pipeline.errors import InputError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MAX_MJCF_BYTES = 50_000_000
MAX_MJCF_GEOMS = 50_000  # of one file, copies by ``<replicate>`` counted


def parse_xml(path: Path, max_bytes: int) -> "Element":
    """The root of a file.

    Raises:
        InputError: the file is missing or too large, is not XML, or declares entities or a document type.
    """
    try:
        if path.stat().st_size > max_bytes:
            raise InputError(f"{path}: too large, at most {max_bytes} bytes are read")
        return ElementTree.parse(path, forbid_dtd=True).getroot()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except DefusedXmlException as error:
        raise InputError(f"{path}: refused, it declares a document type or entities") from error
    except InputError:
        raise
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: not readable XML: {' '.join(str(error).split())}") from error


def check_mjcf(path: Path) -> None:
    """Parse an MJCF file and all MJCF files that it includes, before anything expands them.

    Raises:
        InputError: one of them is invalid, or replicates its geoms too often.
    """
    waiting, seen = [path], set()
    while waiting:
        file = waiting.pop()
        if file not in seen:
            seen.add(file)
            waiting += _drawn_in(parse_xml(file, MAX_MJCF_BYTES), path, file)


def _drawn_in(root: "Element", main: Path, file: Path) -> list[Path]:
    """The MJCF files to which ``file`` refers, relative to its own folder or to that of the main file."""
    copies, found, waiting = 0, [], [(root, 1)]
    while waiting:
        element, times = waiting.pop()
        if element.tag == "replicate":
            times *= _count(element)
        copies += times * (element.tag == "geom")
        if copies > MAX_MJCF_GEOMS:
            raise InputError(f"{file}: too many geoms, at most {MAX_MJCF_GEOMS} are built")
        if element.tag in ("include", "model") and (name := element.get("file")):
            found += [p for p in (main.parent / name, file.parent / name) if p.exists()]
        waiting += [(child, times) for child in element]
    return found


def _count(replicate: "Element") -> int:
    """The number of copies of ``<replicate>``; 1 if ``count`` is no number, which MuJoCo refuses."""
    text = replicate.get("count", "")
    return int(text) if text.isdecimal() else 1
