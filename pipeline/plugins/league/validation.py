"""Find the errors for which a judge would reject submitted files, from sarsim or any other program."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from pipeline.arrays import PixelMask, Places, Rgb, Values
from pipeline.errors import InputError
from pipeline.metric_map.io.plans import GeoTag
from pipeline.plugins.league.brief import HANDED_IN
from pipeline.plugins.league.cloud import COMMENTS, NORMAL, RGB, CloudFile, read_cloud
from pipeline.plugins.league.config import ValidationConfig
from pipeline.plugins.league.pois import PoiFile, read_pois
from pipeline.plugins.league.rules import LENGTHS, MAP_COLOURS

HANDED_FILES = {".tiff": "2D map", ".ply": "3D map", ".csv": "list of finds"}
NAME_PATTERN = re.compile(r"RoboCup\d{4}-[^-]+-.+")
REQUIRED_ELEMENTS = ("file_name", "scale", "grid", "start", "walls", "path")
"""Elements that every 2D map must contain, each with a single colour."""


def handed_in_files(folder: Path) -> dict[str, list[Path]]:
    """The files in a folder, or in its subfolder ``handed_in/``, by the file endings in ``HANDED_FILES``.

    Raises:
        InputError: the folder does not exist, or contains no such files.
    """
    place = folder / HANDED_IN if (folder / HANDED_IN).is_dir() else folder
    try:
        names = sorted(place.iterdir())
    except OSError as error:
        raise InputError(f"{place}: the folder cannot be read: {error.strerror or error}") from error
    found = {ending: [path for path in names if path.suffix.lower() == ending] for ending in HANDED_FILES}
    if not any(found.values()):
        raise InputError(f"{place}: no files to check; their names must end in {', '.join(HANDED_FILES)}")
    return found


def validate(folder: Path, *, config: ValidationConfig = ValidationConfig()) -> list[str]:
    """The errors for which a judge would reject the files, one line each; errors in a file begin with its name.

    Raises:
        InputError: the folder does not exist or contains no files to check, or a file cannot be read at all.
    """
    files = handed_in_files(folder)
    errors = [f"no {what} (*{ending})" for ending, what in HANDED_FILES.items() if not files[ending]]
    lists = {path: read_pois(path) for path in files[".csv"]}
    headers = [read.header for read in lists.values()]
    for path, read in lists.items():
        errors += _with_file_name(path, [*_list_name_errors(path, read), *read.errors])
    for path in files[".ply"]:
        errors += _with_file_name(
            path, [*_name_errors(path, headers), *cloud_errors(read_cloud(path), headers, config)]
        )
    types = {poi.type for read in lists.values() for poi in read.pois}
    for path in files[".tiff"]:
        errors += _with_file_name(path, [*_name_errors(path, headers), *map_errors(path, types, config)])
    return errors


def _with_file_name(path: Path, errors: list[str]) -> list[str]:
    return [f"{path.name}: {error}" for error in errors]


def _letters(*texts: str) -> str:
    """The letters and digits of texts, because programs replace other characters in file names in different ways."""
    return re.sub(r"[\W_]", "", "".join(texts)).casefold()


def _stem(header: dict[str, str]) -> str:
    return _letters(
        "RoboCup", header.get("date", "").partition("-")[0], header.get("team", ""), header.get("mission", "")
    )


def _list_name_errors(path: Path, read: PoiFile) -> Iterator[str]:
    """Errors in a list's name, which must match the year, team, mission and start time in its header."""
    if not NAME_PATTERN.fullmatch(path.stem) or not path.stem.endswith("-pois"):
        yield "must be named RoboCup[Year]-[Team]-[Mission]-[StartTime]-pois.csv"
    elif _letters(path.stem) != _stem(read.header) + _letters(read.header.get("time", ""), "pois"):
        yield "the file name must match the year, team, mission and start time in the header"


def _name_errors(path: Path, headers: list[dict[str, str]]) -> Iterator[str]:
    """Errors in a map's name, which must match the year, team and mission of one of the lists."""
    if not NAME_PATTERN.fullmatch(path.stem):
        yield f"must be named RoboCup[Year]-[Team]-[Mission]{path.suffix}"
    elif headers and _letters(path.stem) not in map(_stem, headers):
        yield "the file name must match the year, team and mission in the header of the list of finds"


def cloud_errors(read: CloudFile, headers: list[dict[str, str]], config: ValidationConfig) -> list[str]:
    """The errors in a 3D map, whose comments must name the team, time and mission in the lists' ``headers``."""
    errors = list(read.errors)
    comments = " ".join(read.comments)
    for name, key in zip(COMMENTS, ("team", "time", "mission"), strict=True):
        values = [header[key] for header in headers if header.get(key)]
        if len(read.comments) < len(COMMENTS):
            errors.append(
                f"must have at least {len(COMMENTS)} comments, one with the {name}; found: {len(read.comments)}"
            )
        elif values and not any(value in comments for value in values):
            errors.append(f"no comment names the {name}, {' or '.join(map(repr, sorted(set(values))))}")
    points = read.rows()
    if len(points):
        errors += [*_position_errors(points, config), *_extra_errors(read, config.normal_tolerance)]
    elif not errors:
        errors.append("contains no points")
    return errors


def _position_errors(points: Places, config: ValidationConfig) -> Iterator[str]:
    """Errors in the points, which must be in metres, with the origin on the floor among them."""
    extent = float(np.ptp(points, axis=0).max())
    if not config.smallest <= extent <= config.largest:
        limits = f"{config.smallest:g} to {config.largest:g} m"
        yield f"the points extend over {extent:.4g} m instead of {limits}; coordinates must be in metres"
        return
    near = points[np.linalg.norm(points[:, :2], axis=1) < config.around, 2]
    if not len(near):
        yield f"no point is within {config.around:g} m of the origin, which must be at the front of the robot's start"
    elif abs(floor := float(np.quantile(near, config.floor_quantile))) > config.floor_tolerance:
        yield f"the floor around the origin is at z = {floor:.2f} m; it must be at z = 0, with z pointing up"


def _extra_errors(read: CloudFile, tolerance: float) -> Iterator[str]:
    """Errors in colours, normals and confidences; the length of a normal must be within ``tolerance`` of 1."""
    rgb, normals = read.rows(RGB), read.rows(NORMAL)
    confidence = read.columns.get("confidence", np.zeros(0))
    if ((rgb < 0) | (rgb > np.iinfo(np.uint8).max) | (rgb % 1 > 0)).any():
        yield "colours must be whole numbers from 0 to 255"
    if (abs(np.linalg.norm(normals, axis=1) - 1) > tolerance).any():
        yield f"normals must have a length of 1 ± {tolerance:g}"
    if ((confidence < 0) | (confidence > 1)).any():
        yield "confidences must be between 0 and 1"


def map_errors(path: Path, types: set[str], config: ValidationConfig) -> list[str]:
    """The errors in a 2D map, on which finds of all ``types`` must be drawn."""
    try:
        with Image.open(path, formats=["TIFF"]) as picture:
            scale = np.atleast_1d(np.asarray(picture.tag_v2.get(GeoTag.PIXEL_SCALE, ()), np.float64))  # type: ignore[attr-defined]
            image = np.asarray(picture)
    except Exception as error:  # of many types: about the file, its compression or its size
        return [f"not a readable TIFF file: {' '.join(str(error).split())}"]
    if image.ndim != 3 or image.shape[2] < 3 or image.dtype != np.uint8:
        return ["must be an RGB or RGBA image with 8 bits per channel"]
    image = image[..., :3]
    return [*_scale_errors(image, scale), *_element_errors(image, types, config.min_grey_fraction)]


def _scale_errors(image: Rgb, scale: Values) -> Iterator[str]:
    """Errors in the pixel size, which must be given and agree with the scale at the top right."""
    if len(scale) < 2 or not (np.isfinite(scale[:2]) & (scale[:2] > 0)).all():
        yield "no pixel size: the GeoTIFF tag ModelPixelScale is missing or invalid"
        return
    height, width = image.shape[:2]
    line = _longest_run(_mask_of(image[: height // 2, width // 2 :], "scale"))
    if scale[0] != scale[1]:
        yield f"pixels must be square, not {scale[0]:g} × {scale[1]:g} m"
    elif not line:
        yield f"no scale at the top right: draw a line of {LENGTHS['scale']:g} m in RGB {MAP_COLOURS['scale']}"
    elif abs(line * scale[0] - LENGTHS["scale"]) > scale[0]:
        yield f"the scale must be 1 m long, but its {line} pixels of {scale[0]:g} m are {line * scale[0]:.3f} m long"


def _mask_of(image: Rgb, element: str) -> PixelMask:
    """The pixels of an image that have the colour of an element."""
    return np.asarray((image == np.array(MAP_COLOURS[element], np.uint8)).all(axis=-1))


def _longest_run(mask: PixelMask) -> int:
    """Length of the longest horizontal run of pixels in a mask."""
    ends = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1).ravel()
    runs = np.flatnonzero(ends < 0) - np.flatnonzero(ends > 0)
    return int(runs.max(initial=0))


def _element_errors(image: Rgb, types: set[str], min_fraction: float) -> Iterator[str]:
    """Errors about missing or misplaced elements, which are recognised by their colours.

    ``min_fraction``: minimum fraction of the pixels along the image's border for each grey of the checkerboard.
    """
    for element in (*REQUIRED_ELEMENTS, *sorted(types & MAP_COLOURS.keys())):
        if not _mask_of(image, element).any():
            yield f"no {element.replace('_', ' ')}: no pixel has the colour RGB {MAP_COLOURS[element]}"
    title = _mask_of(image, "file_name")
    if title.any() and not title[: image.shape[0] // 2, : image.shape[1] // 2].any():
        yield "the file name must be drawn at the top left"
    is_grey = image.max(axis=-1) == image.min(axis=-1)
    if not (is_grey & (image[..., 0] >= MAP_COLOURS["searched"][0])).any():
        yield f"no searched area: no pixel has a grey from RGB {MAP_COLOURS['searched']} to {MAP_COLOURS['text']}"
    frame = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    colours, counts = np.unique(frame, axis=0, return_counts=True)
    greys = np.ptp(colours[counts >= min_fraction * len(frame)].astype(int), axis=1) <= 2
    if greys.sum() < 2:
        yield "no checkerboard: the edges of the image must show unexplored area in two greys"
