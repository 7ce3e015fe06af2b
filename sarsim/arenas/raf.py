"""Rescue arenas from ``.raf`` files, the XML format of the hector_nist_arena_designer.

A file lists elements, each with a type, a tile, a rotation (clockwise, in degrees) and, for some types, further
attributes. Tiles are 1.2 m wide; offsets are in tiles along the world's axes. An element that hangs on a wall
(``victim_*``, ``start_check*``, ``hazmat*``) is shifted to a mount point of the wall with the same tile and rotation.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Place
from pipeline.errors import InputError
from sarsim.arenas.element_things import add_things
from sarsim.arenas.elements import TILE_SIZE, ArenaBuilder, element_library
from sarsim.vetting.model_files import parse_xml

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MAX_BYTES = 2_000_000
MAX_ELEMENTS = 1500
MAX_EXTENT = 60  # Maximum extent along x or y, tiles; 72 m
MAX_GEOMS = 15_000
FLOOR_MARGIN = 0.5  # m by which the floor extends beyond the outermost tiles

TYPES = frozenset(
    (
        *("half_ramp", "half_ramp_shifted", "full_ramp", "elevated_ramps", "elevated_floor_120"),
        *("small_wall", "small_wall_qr", "small_wall_start_check", "small_wall_no_tex", "tall_wall"),
        *("wall_holes1", "small_wall_triple_holes", "wall_diag_120", "corner_diag_120", "veil_wall"),
        *("simple_elev_ramp", "stairs_120", "stepfield_red_diagonal", "manip_storage", "wooden_block"),
        *("fiducial_barrel", "fiducial_barrel_high", "red_barrel", "pvc_pipe", "fire_extinguisher"),
        *("floor_tile_black", "floor_tile_white", "victim_1", "spectator_120"),
    )
)
"""Types that have the same name in the element library; the library has further elements for random arenas."""
TYPE_PREFIXES = {
    "victim_with_box": "victim_with_box",
    "victim_doll_": "victim_with_box",
    "hazmat": "hazmat_sign",
    "start_check": "start_check",
}
"""Prefixes of further types, each with the library element that gives these types their shape."""
_HANGING_PREFIXES = ("victim_", "start_check", "hazmat")
ATTRIBUTES = "type", "x", "y", "rotation", "mount-point", "offset-x", "offset-y"


@dataclass(frozen=True)
class RafElement:
    """An ``<element>`` of a ``.raf`` file.

    Attributes:
        type: type as written in the file.
        x, y: position in tiles, including the offset.
        rotation: clockwise rotation, degrees.
        mount_point: index into the mount points of the element's wall.
        tile: x and y of the tile without the offset, and rotation, degrees; together, they identify the wall.
    """

    type: str
    x: float
    y: float
    rotation: float
    mount_point: int
    tile: tuple[float, float, float]

    @property
    def kind(self) -> str:
        """Name of the element in the library."""
        return _kind(self.type) or self.type


def _kind(type_: str) -> str | None:
    """Name of the library element for a type; None if the type is unknown."""
    return (
        type_
        if type_ in TYPES
        else next((k for prefix, k in TYPE_PREFIXES.items() if type_.startswith(prefix)), None)
    )


def read_raf(path: Path) -> list[RafElement]:
    """The elements of a file.

    Raises:
        InputError: the file is missing or too large, is not XML of this format, or contains numbers out of range or
            elements of unknown types.
    """
    root = parse_xml(path, MAX_BYTES)
    if root.tag != "elements":
        raise InputError(f"{path}: the root element of a .raf file must be <elements>, not <{root.tag[:40]}>")
    lines = list(root)
    if other := next((line.tag for line in lines if line.tag != "element"), None):
        raise InputError(f"{path}: <elements> may contain only <element>, not <{other[:40]}>")
    if not lines:
        raise InputError(f"{path}: contains no <element>; an arena needs at least one")
    if len(lines) > MAX_ELEMENTS:
        raise InputError(f"{path}: has {len(lines)} elements; the limit is {MAX_ELEMENTS}")
    elements = [_element(f"{path}, element {n}", line) for n, line in enumerate(lines, 1)]
    _check_extent(path, elements)
    return elements


def build_raf(path: Path) -> ArenaBuilder:
    """Build the arena of a file, without marking a start; InputError if the file is invalid or too large."""
    elements = read_raf(path)
    _check_geoms(path, elements)
    builder = ArenaBuilder(path.stem)
    for element, position in _positions(elements):
        builder.add_element(element.kind, position, -element.rotation)
        add_things(builder, element.type, position, -element.rotation)
    builder.drop_covered_panels()
    low, high = builder.bounds
    tiles = TILE_SIZE * np.array([(e.x, e.y) for e in elements])
    low = np.minimum(low, tiles.min(axis=0) - TILE_SIZE / 2) - FLOOR_MARGIN
    high = np.maximum(high, tiles.max(axis=0) + TILE_SIZE / 2) + FLOOR_MARGIN
    builder.add_floor(low, high)
    builder.add_surroundings(low, high)
    return builder


def _element(where: str, line: "Element") -> RafElement:
    """Parse an ``<element>``; ``where``: its location for error messages."""
    for name in sorted(set(line.attrib) - set(ATTRIBUTES)):
        raise InputError(f"{where}: unknown attribute {name[:40]!r}{_suggestion(name, ATTRIBUTES)}")
    type_ = _text(where, line, "type")
    if _kind(type_) is None:
        raise InputError(f"{where}: unknown type {type_[:40]!r}{_suggestion(type_, [*TYPES, *TYPE_PREFIXES])}")
    x, y, rotation = (_number(where, line, name) for name in ("x", "y", "rotation"))
    mount_point = _number(where, line, "mount-point", "0")
    if mount_point != int(mount_point) or mount_point < 0:
        raise InputError(f"{where}: mount-point must be a non-negative integer, not {line.get('mount-point')!r}")
    return RafElement(
        type=type_,
        x=x + _number(where, line, "offset-x", "0"),
        y=y + _number(where, line, "offset-y", "0"),
        rotation=rotation,
        mount_point=int(mount_point),
        tile=(x, y, rotation % 360),
    )


def _suggestion(word: str, words: Iterable[str]) -> str:
    """End of an error message that suggests the word most similar to ``word``; empty if no word is similar."""
    return "".join(f"; perhaps you meant {near}" for near in get_close_matches(word, words, n=1))


def _text(where: str, line: "Element", name: str, default: str | None = None) -> str:
    value = line.get(name, default)
    if value is None:
        raise InputError(f"{where}: the attribute {name!r} is missing")
    return value


def _number(where: str, line: "Element", name: str, default: str | None = None) -> float:
    text = _text(where, line, name, default)
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value) or abs(value) > 1e6:
        raise InputError(f"{where}: {name} must be a number from -1000000 to 1000000, not {text[:40]!r}")
    return value


def _check_extent(path: Path, elements: list[RafElement]) -> None:
    for axis in ("x", "y"):
        tiles = [getattr(e, axis) for e in elements]
        if max(tiles) - min(tiles) > MAX_EXTENT or max(map(abs, tiles)) > 10 * MAX_EXTENT:
            raise InputError(
                f"{path}: the elements extend from {axis}={min(tiles):g} to {axis}={max(tiles):g};"
                f" they must span at most {MAX_EXTENT} tiles and lie within {10 * MAX_EXTENT} tiles of {axis}=0"
            )


def _check_geoms(path: Path, elements: list[RafElement]) -> None:
    library = element_library()
    geoms = sum(len(library.geoms(e.kind)) for e in set(elements))
    if geoms > MAX_GEOMS:
        raise InputError(f"{path}: the elements consist of {geoms} geoms; the limit is {MAX_GEOMS}")


def _positions(elements: list[RafElement]) -> Iterator[tuple[RafElement, NDArray[np.float64]]]:
    """Yield each element with its origin (3,) m; repeated elements are yielded only once."""
    library = element_library()
    walls: dict[tuple[float, float, float], NDArray[np.float64]] = {}
    for element in elements:
        mounts = library.mount_points(element.kind)
        if len(mounts):
            walls.setdefault(element.tile, mounts)
    for element in dict.fromkeys(elements):
        origin = np.array([TILE_SIZE * element.x, TILE_SIZE * element.y, 0.0])
        yield element, origin + _shift(element, walls.get(element.tile))


def _shift(element: RafElement, mounts: NDArray[np.float64] | None) -> Place:
    """(3,) m, offset from a tile to the element's mount point; zero if the element does not hang on a wall."""
    if mounts is None or not element.type.startswith(_HANGING_PREFIXES) or element.mount_point >= len(mounts):
        return np.zeros(3)
    along, up = mounts[element.mount_point]
    yaw = -np.radians(element.rotation)
    return np.array([along * np.cos(yaw), along * np.sin(yaw), up])
