"""Which colour image belongs to which depth image of a folder, and when they were taken."""

import re
from math import gcd
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.arrays import Values
from pipeline.errors import InputError
from pipeline.files import read_text
from pipeline.frame import SAME_TIME
from pipeline.localisation.trajectory import LEAST_SINCE_1970, in_seconds

IMAGE_ENDINGS = (".png", ".jpg", ".jpeg", ".ppm", ".pgm", ".tif", ".tiff")
DEPTH, COLOUR = ("depth",), ("rgb", "color")  # Names of lists and of folders
NUMBER = re.compile(r"\d{9,}\.\d+|\d+")  # In file names: s since 1970 have decimals, other numbers are whole
Key = tuple[float, ...]


class Pair(NamedTuple):
    """A depth image with the time at which it was taken, s, and its colour image; None if it has none."""

    time: float
    depth: Path
    colour: Path | None


class _Images(NamedTuple):
    """Images of one kind, and their times, s; None if they have no times."""

    files: list[Path]
    times: Values | None


def image_pairs(path: Path, fps: float | None, most_step: float) -> list[Pair]:
    """The depth images of a folder in chronological order, each with its colour image.

    If there is a file of associations (``assoc*.txt``: time and file of one kind, time and file of the other), it
    gives the pairs. Otherwise images are paired by their times, from ``depth.txt`` and ``rgb.txt`` or from the file
    names, or, without times, by the numbers in the names.

    Args:
        path: the folder.
        fps: images per second, for images without times.
        most_step: maximum median time between images, s; if it is longer, times cannot be in s.

    Raises:
        InputError: there are no images, a list is malformed, or nothing says when the images were taken.
    """
    pairs = _associated(path)
    if pairs is None:
        depth, colour = _images(path, DEPTH), _images(path, COLOUR)
        pairs = _by_time(depth, colour) or _by_number(path, depth, colour, fps)
    pairs = sorted(pairs, key=lambda pair: pair.time)
    step = float(np.median(np.diff([pair.time for pair in pairs]))) if len(pairs) > 1 else 0.0
    if step > most_step:
        found = f"the median interval between images is {step:g} s, and the limit is {most_step:g} s"
        raise InputError(f"{path}: {found}; give times in s, or in ms, µs or ns since 1970")
    return pairs


def holds_images(path: Path) -> bool:
    """Whether a folder has depth images, or a list or a file of associations of them."""
    listed = any((path / f"{name}.txt").exists() or _files(path / name) for name in DEPTH)
    return listed or bool(_association_rows(path))


def _files(folder: Path) -> list[Path]:
    return [file for file in folder.glob("*") if file.suffix.lower() in IMAGE_ENDINGS]


def _associated(path: Path) -> list[Pair] | None:
    """The pairs in a file of associations; None if there is none."""
    rows = _association_rows(path)
    if rows is None:
        return None
    first = 0 if "depth" in rows[0][1].lower() else 2
    times = in_seconds(np.array([float(row[first]) for row in rows]))
    pairs = zip(times.tolist(), rows, strict=True)
    return [Pair(time, path / row[first + 1], path / row[3 - first]) for time, row in pairs]


def _association_rows(path: Path) -> list[list[str]] | None:
    """The lines, as words, of the first file that associates depth with colour images; None if there is none.

    Raises:
        InputError: a line does not have this format.
    """
    for file in sorted(path.glob("assoc*.txt")):
        rows = [(n, words) for n, line in enumerate(read_text(file).splitlines(), 1) if (words := _words(line))]
        if not rows or len(rows[0][1]) != 4 or sum("depth" in rows[0][1][k].lower() for k in (1, 3)) != 1:
            continue  # It associates something else, such as images with poses
        for number, row in rows:
            if len(row) != 4 or not all(_is_number(row[k]) for k in (0, 2)):
                found = " ".join(row)[:60]
                raise InputError(f"{file}: line {number} must have the form TIME FILE TIME FILE, not {found!r}")
        return [row for _, row in rows]
    return None


def _words(line: str) -> list[str]:
    return line.partition("#")[0].replace(",", " ").split()


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def _images(path: Path, names: tuple[str, ...]) -> _Images:
    """The images of one kind, from a list or, without a list, a folder that has one of the names."""
    for name in names:
        if (path / f"{name}.txt").exists():
            return _from_list(path / f"{name}.txt")
    for name in names:
        if files := _files(path / name):
            return _from_names(files)
    lists, folders = ", ".join(f"{name}.txt" for name in names), " or ".join(f"{name}/" for name in names)
    raise InputError(f"{path}: not a recording: it must contain {lists} or images in {folders}")


def _from_list(file: Path) -> _Images:
    """The images in a list of times and files; without times if several images all have the same time."""
    found = []
    for number, line in enumerate(read_text(file).splitlines(), 1):
        words = _words(line)
        if not words:
            continue
        if len(words) < 2 or not _is_number(words[0]):
            raise InputError(f"{file}: line {number} must contain a time and a file, not {line[:60]!r}")
        found.append((float(words[0]), file.parent / words[1]))
    if not found:
        raise InputError(f"{file}: lists no images; each line must contain a time and a file")
    times = in_seconds(np.array([time for time, _ in found]))
    return _Images([name for _, name in found], times if len(found) == 1 or np.ptp(times) else None)


def _from_names(files: list[Path]) -> _Images:
    """Images sorted by the numbers in their names, which are taken for times if they are large enough."""
    files = sorted(files, key=lambda file: ([*map(float, NUMBER.findall(file.stem))], file.name))
    keys = _keys(files)
    if keys is None or len(keys[0]) != 1:
        return _Images(files, None)
    times = in_seconds(np.array(keys)[:, 0])
    return _Images(files, times if np.median(times) > LEAST_SINCE_1970 else None)


def _keys(files: list[Path]) -> list[Key] | None:
    """For each name, the numbers that differ between names, or else the last; None if these are not unique."""
    numbers = [tuple(map(float, NUMBER.findall(file.stem))) for file in files]
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
        times = _places(keys, others) / fps
    by_key = dict(zip(others, colour.files, strict=True))
    found = zip(times.tolist(), keys, depth.files, strict=True)
    return [Pair(time, file, by_key.get(key)) for time, key, file in found]


def _places(keys: list[Key], others: list[Key]) -> Values:
    """Number of images taken before each of ``keys``, including lost ones, as inferred from the numbers."""
    every = sorted({*keys, *others})
    if len(every[0]) > 1 or len(every[-1]) > 1:
        return np.array([every.index(key) for key in keys], float)
    first = every[0][0]
    step = gcd(*(int(key[0] - first) for key in every)) or 1
    return np.array([(key[0] - first) / step for key in keys])
