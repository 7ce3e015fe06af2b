"""Checks the files of an untrusted model, as plain XML and by size, before other code opens or expands the files.

Like tinyxml2, with which Gazebo and MuJoCo read XML, the parser accepts more than the standard allows.
"""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from defusedxml import DefusedXmlException, ElementTree

from pipeline.errors import InputError
from pipeline.files import MAX_TEXT_BYTES, check_regular, read_bytes

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MAX_MODEL_BYTES = 100_000_000  # Maximum total size of a model's files: MJCF, meshes, textures and height fields
MAX_GEOMS = 6_000  # Including copies by ``<replicate>``; PyMJCF takes 2 ms per geom; esogu_52x15 has 1,600
MJCF_SUFFIXES = ".xml", ".mjcf"
FOLDERS = ("meshdir", "texturedir", "assetdir")
"""Attributes of ``<compiler>`` that name folders."""
_MARKERS = {"<!--": "-->", "<![CDATA[": "]]>", "<?": "?>"}
"""Start and end markers of comments, CDATA sections and processing instructions."""
_NAME = r"[^\s<>/=\"'&!?]+"
_ATTRIBUTE = re.compile(rf"\s*({_NAME})\s*=\s*(\"[^\"]*\"|'[^']*')")
_TAG = re.compile(rf"<(/?)({_NAME})((?:{_ATTRIBUTE.pattern.replace('(', '(?:')})*)\s*(/?)>")
_BARE_AMPERSAND = re.compile(r"&(?!(?:amp|lt|gt|quot|apos|#\d+|#x[0-9a-fA-F]+);)")
_CONTROL = re.compile("[\x01-\x08\x0b\x0c\x0e-\x1f]")
_NOT_UTF8 = re.compile("[\udc80-\udcff]")


class RefusedError(InputError):
    """Raised for a file that may be harmful, rather than merely broken; no model that refers to the file is read."""


def parse_xml(path: Path, max_bytes: int = MAX_TEXT_BYTES) -> "Element":
    """The root element of a file of at most ``max_bytes`` bytes.

    Raises:
        InputError: the file is missing, not a regular file, too large or not XML, or declares a document type or
            entities, which may expand endlessly or refer to other files.
    """
    content = read_bytes(path, max_bytes)
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
    """The root element of XML that MuJoCo and Gazebo can read, even if the XML violates the standard.

    Raises:
        ParseError: the XML cannot be parsed, even after repair.
        DefusedXmlException: the XML declares a document type or entities.
    """
    try:
        return ElementTree.fromstring(content, forbid_dtd=True)
    except ElementTree.ParseError as error:
        try:
            return ElementTree.fromstring(_repaired(content), forbid_dtd=True)
        except ElementTree.ParseError:
            raise error from None  # The error in the original file


def _repaired(content: bytes) -> str:
    """Repair errors in a file's content that Gazebo and MuJoCo accept but a strict parser would reject.

    The repaired errors are

    - a bare ``&``, and ``<`` in an attribute,
    - control characters, and bytes that are not UTF-8,
    - ``--`` in a comment,
    - text before the declaration or after the root element,
    - missing spaces between attributes, and repeated attributes, of which the first is used, and
    - prefixes without a namespace.

    Mismatched tags and values without quotes, which tinyxml2 rejects, are left unchanged. Document types and entities
    are also left unchanged, so that the parser rejects the file.
    """
    text = content.removeprefix(b"\xef\xbb\xbf").decode("utf-8", "surrogateescape")
    text = _CONTROL.sub(" ", _NOT_UTF8.sub(lambda byte: chr(ord(byte[0]) - 0xDC00), text))
    mended, place, depth = list[str](), 0, 0
    while (start := text.find("<", place)) >= 0:
        mended.append(_BARE_AMPERSAND.sub("&amp;", text[place:start]))
        begin = next((begin for begin in _MARKERS if text.startswith(begin, start)), None)
        if begin is not None:
            end = text.find(_MARKERS[begin], start + len(begin)) + len(_MARKERS[begin])
            if end < start + len(begin):
                break
            if begin == "<![CDATA[":
                mended.append(text[start:end])
        elif (tag := _TAG.match(text, start)) is not None:
            mended.append(_repaired_tag(tag))
            end = tag.end()
            closing, *_, alone = tag.groups()
            depth += -1 if closing else not alone
            if depth <= 0:  # The root element is closed
                return "".join(mended).strip()
        else:
            break
        place = end
    return "".join([*mended, text[max(place, start) :]]).strip()


def _repaired_tag(tag: re.Match[str]) -> str:
    closing, name, attributes, alone = tag.groups()
    values: dict[str, str] = {}
    for key, value in _ATTRIBUTE.findall(attributes):
        values.setdefault(key.replace(":", "."), _BARE_AMPERSAND.sub("&amp;", value).replace("<", "&lt;"))
    written = "".join(f" {key}={value}" for key, value in values.items())
    return f"<{closing}{name.replace(':', '.')}{written}{alone}>"


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
            size = _checked_size(size + file.stat().st_size, path)
            names = [e.get("file", "") for e in roots[file].iter() if e.tag in ("include", "model")]
            waiting += _files_within(path, names, {path.parent, file.parent})
    return roots


def check_files(path: Path) -> None:
    """Check all files of a model before other code opens or builds the model.

    Raises:
        InputError: a file is invalid (see :func:`parse_mjcf`), or the model has too many geoms or refers to a file
            outside its folder or to something other than a regular file.
    """
    roots = parse_mjcf(path)
    if roots[path].tag == "robot":
        raise InputError(
            f"{path}: is URDF (<robot>), not MJCF; convert it with xacro and MuJoCo's compile, then name its parts as"
            " docs/robot.md says"
        )
    if path.suffix.lower() not in MJCF_SUFFIXES:
        raise InputError(f"{path}: the name of an MJCF file must end in {' or '.join(MJCF_SUFFIXES)}; rename it")
    elements = [element for root in roots.values() for element in root.iter()]
    compilers = [element for element in elements if element.tag == "compiler"]
    folders = [e.get(name, "") for e in compilers for name in FOLDERS]
    names = {value for e in elements for name, value in e.attrib.items() if name.startswith("file")}
    bases = {base / folder for base in {file.parent for file in roots} for folder in ("", *folders)}
    size = 0
    for file in set(_files_within(path, names, bases)) | set(roots):
        check_regular(file)
        size = _checked_size(size + file.stat().st_size, path)
    count = sum(map(_geom_count, roots.values()))
    if count > MAX_GEOMS:
        raise InputError(f"{path}: has {count} geoms, including copies; the limit is {MAX_GEOMS}")


def _files_within(path: Path, names: Iterable[str], bases: Iterable[Path]) -> list[Path]:
    """Existing files with ``names`` in folders ``bases``.

    Raises:
        InputError: a file, even one that does not exist, would lie outside the folder of ``path``.
    """
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


def _checked_size(size: int, path: Path) -> int:
    if size > MAX_MODEL_BYTES:
        raise InputError(
            f"{path}: the model's files are too large: at least {size} bytes in all; the limit is {MAX_MODEL_BYTES}"
        )
    return size


def _geom_count(root: "Element") -> int:
    """Number of geoms in a file, including copies."""
    count, waiting = 0, [(root, 1)]
    while waiting:
        element, times = waiting.pop()
        if element.tag == "replicate":
            times *= _copy_count(element)
        count += times * (element.tag == "geom")
        waiting += [(child, times) for child in element]
    return count


def _copy_count(replicate: "Element") -> int:
    """Number of copies that ``<replicate>`` makes; 1 if MuJoCo would not accept its ``count``."""
    text = replicate.get("count", "")
    return int(text) if re.fullmatch("[0-9]{1,9}", text) else 1
