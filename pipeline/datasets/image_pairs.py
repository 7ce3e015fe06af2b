"""Pair the depth and colour images of a folder, and determine the times at which they were taken."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from pipeline.arrays import Values
from pipeline.errors import InputError
from pipeline.files import MAX_MEMORY, read_bytes, read_text
from pipeline.frame import SAME_TIME, decoded
from pipeline.localisation.trajectory import MIN_SINCE_1970, in_seconds

IMAGE_ENDINGS = (".png", ".jpg", ".jpeg", ".ppm", ".pgm", ".tif", ".tiff")
DEPTH, COLOUR = ("depth",), ("rgb", "color")  # Names of lists and of folders
NUMBER = re.compile(r"(?<![\d.])\d+\.\d+(?!\.?\d)|\d+")
"""A number in a file name: a decimal that is not part of text such as 1.2.3, or a whole number."""
ROW = re.compile(r"(?P<time>[^\s,]+)[\s,]+(?P<file>\S.*)")
TWO_ROWS = re.compile(r"(?P<time>\S+) (?P<file>\S.*?\.[A-Za-z]\w*) (?P<other_time>[-+.\deE]+) (?P<other_file>\S.*)")
OWN_FILES = "keyframes.txt", "label.txt"  # Files that only sarsim writes, whose times are in s
MAX_STEP = 2.0  # s, maximum plausible median interval between images whose times have no date
MAX_STEP_OF_DATES = 3600.0  # s, maximum median interval between dates; numbers farther apart are not dates
UNITS = {1.0: "s", 1e3: "ms", 1e6: "µs", 1e9: "ns"}
"""Names of units of time, by the number of units in a second."""
Key = tuple[float, ...]  # Numbers in the name of an image by which it is paired with another image
Note = Callable[[str], None]  # Function that receives a line about an assumption


class Pair(NamedTuple):
    """A depth image, the time at which it was taken, s, and its colour image; None if it has no colour image."""

    time: float
    depth: Path
    colour: Path | None


class _Images(NamedTuple):
    """Files of the images of one kind, and (N,) times of the images, s; None if they have no times."""

    files: list[Path]
    times: Values | None


def image_pairs(path: Path, fps: float | None, note: Note = lambda line: None) -> list[Pair]:
    """The depth images of a folder in chronological order, each with its colour image.

    A file of associations, ``assoc*.txt``, gives the pairs if it exists; each line contains the time and file of one
    image, then the time and file of the other. Otherwise, images are paired by their times in ``depth.txt`` and
    ``rgb.txt`` or in the file names. Images without times are paired by the numbers in their names.

    Args:
        path: the folder.
        fps: images per second, for images without times or with frame numbers instead of times.
        note: receives a line for each assumption.

    Raises:
        InputError: there are no images, a list is malformed, or the times or the order of the images are unknown.
    """
    pairs = _associated(path, fps, note)
    if pairs is None:
        depth, colour = _images(path, DEPTH, fps, note), _images(path, COLOUR, fps, note)
        pairs = _by_time(depth, colour) or _by_number(path, depth, colour, fps)
    return sorted(dict.fromkeys(pairs), key=lambda pair: pair.time)  # each once, even if it is listed twice


def _seconds(file: Path, times: Values, fps: float | None, note: Note) -> Values:
    """The times in a list, converted to s; the unit follows from the size of dates or from the intervals."""
    dates, step = _dates(times), float(np.median(np.diff(np.unique(times)))) if np.ptp(times) else 0.0
    if dates is not None:
        return dates
    if any((file.parent / name).exists() for name in OWN_FILES):
        return times
    if step == 1 and not np.any(times % 1):
        if fps is not None:
            return times / fps
        note(f"{file.name}: the times count by ones, and are taken for s; if they are frame numbers, give --fps")
    unit = next((unit for unit in UNITS if step / unit <= MAX_STEP), None)
    if unit is None:
        raise InputError(f"{file}: the median interval between images is {step:g}; give times in s, ms, µs or ns")
    if unit != 1:
        note(f"{file.name}: the times are taken for {UNITS[unit]}, as {step:g} s between images are too long")
    return times / unit


def _dates(times: Values) -> Values | None:
    """Times since 1970 in any unit, converted to s; None if they cannot be times since 1970."""
    found = in_seconds(times)
    step = np.median(np.diff(np.unique(found))) if np.ptp(found) else 0.0
    return found if np.median(found) > MIN_SINCE_1970 and step <= MAX_STEP_OF_DATES else None


def holds_images(path: Path) -> bool:
    """Whether a folder has depth images, a list of depth images, or a file of associations.

    Raises:
        InputError: a line of a file of associations is malformed.
    """
    listed = any((path / f"{name}.txt").exists() or _files(path / name) for name in DEPTH)
    return listed or bool(_association_rows(path))


def _files(folder: Path) -> list[Path]:
    files = (file for file in folder.glob("*") if not file.name.startswith("."))
    return [file for file in files if file.suffix.lower() in IMAGE_ENDINGS]


def _associated(path: Path, fps: float | None, note: Note) -> list[Pair] | None:
    """The pairs in a file of associations; None if there is no such file."""
    found = _association_rows(path)
    if found is None:
        return None
    file, rows = found
    times = _seconds(file, np.array([float(row[0]) for row in rows]), fps, note)
    return [
        Pair(time, path / depth, path / colour) for time, (_, depth, colour) in zip(times.tolist(), rows, strict=True)
    ]


def _association_rows(path: Path) -> tuple[Path, list[tuple[str, str, str]]] | None:
    """The first file that associates depth with colour images, and its lines: time, file of depth, file of colour.

    None if there is no such file.

    Raises:
        InputError: a line does not have the form TIME FILE TIME FILE.
    """
    for file in sorted(path.glob("assoc*.txt")):
        lines = [
            (number, TWO_ROWS.fullmatch(" ".join(line.replace(",", " ").split())), line)
            for number, line in _lines(file)
        ]
        first = lines[0][1] if lines else None
        kinds = first and [_is_depth(path, first[name]) for name in ("file", "other_file")]
        if kinds is None or sum(kinds) != 1:
            continue  # It associates something else, such as images with poses
        rows = []
        for number, row, line in lines:
            if row is None or not (_is_number(row["time"]) and _is_number(row["other_time"])):
                raise InputError(f"{file}: line {number} must have the form TIME FILE TIME FILE, not {line[:60]!r}")
            time, *names = row.groups() if kinds[0] else (row["other_time"], row["other_file"], "", row["file"])
            rows.append((time, names[0], names[2]))
        return file, rows
    return None


def _is_depth(path: Path, name: str) -> bool:
    """Whether a listed image is a depth image, by its name or, failing that, its content."""
    if "depth" in name.lower() or not (path / name).is_file():
        return "depth" in name.lower()
    try:
        image = decoded(read_bytes(path / name, MAX_MEMORY), cv2.IMREAD_UNCHANGED)
    except InputError:
        return False
    return image.ndim == 2 and image.dtype != np.uint8


def _lines(file: Path) -> list[tuple[int, str]]:
    """The numbers and contents of the lines of a list that are neither empty nor comments."""
    lines = ((number, line.strip()) for number, line in enumerate(read_text(file).splitlines(), 1))
    return [(number, line) for number, line in lines if line and not line.startswith("#")]


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def _images(path: Path, names: tuple[str, ...], fps: float | None, note: Note) -> _Images:
    """The images of one kind, from a list or else a folder that has one of the names."""
    for name in names:
        if (path / f"{name}.txt").exists():
            return _from_list(path / f"{name}.txt", fps, note)
    for name in names:
        if files := _files(path / name):
            return _from_names(files)
    lists, folders = ", ".join(f"{name}.txt" for name in names), " or ".join(f"{name}/" for name in names)
    raise InputError(f"{path}: not a recording: it must contain {lists} or images in {folders}")


def _from_list(file: Path, fps: float | None, note: Note) -> _Images:
    """The images in a list of times and files; without times if several images all have the same time."""
    times, files = [], []
    for number, line in _lines(file):
        row = ROW.fullmatch(line)
        if row is None or not _is_number(row["time"]):
            raise InputError(f"{file}: line {number} must contain a time and a file, not {line[:60]!r}")
        times.append(float(row["time"]))
        files.append(_listed(file.parent, row["file"]))
    if not files:
        raise InputError(f"{file}: lists no images; each line must contain a time and a file")
    is_timed = len(files) == 1 or np.ptp(times) > 0
    return _Images(files, _seconds(file, np.array(times), fps, note) if is_timed else None)


def _listed(folder: Path, rest: str) -> Path:
    """The image named by the rest of a line; the name may contain spaces and precede a comment or more columns."""
    names = rest, rest.strip("\"'"), rest.partition(" #")[0].strip(), re.split(r"[\s,]", rest)[0]
    return next((folder / name for name in names if (folder / name).is_file()), folder / rest)


def _from_names(files: list[Path]) -> _Images:
    """Images sorted by the numbers in their names, which are used as times if they are dates.

    Raises:
        InputError: the names differ in more than their numbers, so that the order of the images is unknown.
    """
    files = sorted(files, key=lambda file: (_numbers(file), file.name))
    texts = {NUMBER.sub("0", file.stem.lower()): file.name for file in reversed(files)}
    if len(texts) > 1 and any(map(_numbers, files)):
        first, second, *_ = sorted(texts.values())
        found = f"the names {first} and {second} differ in more than numbers, so the order of the images is unknown"
        raise InputError(
            f"{files[0].parent}: {found}; list the images with their times in {files[0].parent.name}.txt"
        )
    keys = _keys(files)
    return _Images(files, None if keys is None or len(keys[0]) != 1 else _dates(np.array(keys)[:, 0]))


def _numbers(file: Path) -> Key:
    return tuple(map(float, NUMBER.findall(file.stem)))


def _keys(files: list[Path]) -> list[Key] | None:
    """For each file, the numbers in its name that differ between the names, or else the last number.

    None if the counts of numbers in the names differ, or if the keys are not unique.
    """
    numbers = [_numbers(file) for file in files]
    if not numbers[0] or len(set(map(len, numbers))) > 1:
        return None
    columns = [k for k, column in enumerate(zip(*numbers, strict=True)) if len(set(column)) > 1] or [-1]
    keys = [tuple(row[k] for k in columns) for row in numbers]
    return keys if len(set(keys)) == len(keys) else None


def _by_time(depth: _Images, colour: _Images) -> list[Pair]:
    """Depth images with the colour images nearest in time; empty if either kind has no times."""
    if depth.times is None or colour.times is None:
        return []
    pairs = []
    for time, file in zip(depth.times.tolist(), depth.files, strict=True):
        nearest = int(np.abs(colour.times - time).argmin())
        is_near = abs(colour.times[nearest] - time) <= SAME_TIME
        pairs.append(Pair(time, file, colour.files[nearest] if is_near else None))
    return pairs


def _by_number(path: Path, depth: _Images, colour: _Images, fps: float | None) -> list[Pair]:
    """Depth images with the colour images that have the same numbers."""
    keys, others = _keys(depth.files), _keys(colour.files)
    if keys is None or others is None:
        if len(depth.files) != len(colour.files):
            pairs = f"{len(depth.files)} depth and {len(colour.files)} colour images"
            raise InputError(
                f"{path}: {pairs} cannot be paired by the numbers in their names; list them in associations.txt"
            )
        keys = others = [(float(k),) for k in range(len(depth.files))]
    times = depth.times
    if times is None:
        if fps is None:
            raise InputError(
                f"{depth.files[0].parent}: the images have no timestamps; give the frame rate with --fps"
            )
        times = _frame_numbers(keys, others) / fps
    by_key = dict(zip(others, colour.files, strict=True))
    found = zip(times.tolist(), keys, depth.files, strict=True)
    return [Pair(time, file, by_key.get(key)) for time, key, file in found]


def _frame_numbers(keys: list[Key], others: list[Key]) -> Values:
    """(N,) number of images taken before the image of each key, including lost images, inferred from the keys."""
    every = sorted({*keys, *others})
    if len(every[0]) > 1 or len(every[-1]) > 1:
        return np.array([every.index(key) for key in keys], float)
    first = every[0][0]
    step = np.median(np.diff([key[0] for key in every])) if len(every) > 1 else 1.0
    return np.array([(key[0] - first) / step for key in keys])
