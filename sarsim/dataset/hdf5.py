"""HDF5 files that are written completely or raise an error, and that are checked before they are read."""

import io
import zlib
from contextlib import ExitStack
from math import prod
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.files import GOOD, answer_apart, check_regular

FAST = {"compression": "gzip", "compression_opts": 1}
"""HDF5's other fast filter, LZF, makes different bytes of the same data each time."""
SECONDS, MEMORY = 3, 1_000_000_000
"""of processor time and bytes, to check a file; sarsim's own files need hundredths of a second and a few MB."""
_RAW = -15  # zlib's code for a stream without header and checksum, with the largest window
_ZLIB_HEAD = b"\x78\x01"  # RFC 1950: deflate, the largest window, fastest


def write_noisy(dataset: h5py.Dataset, index: int, image: NDArray[np.uint16]) -> None:
    """Write one image in the format of the filters shuffle and gzip, in a fifth of their time.

    The low bytes of a noisy image hardly shrink, so they are stored uncompressed in gzip's stream (RFC 1951, 3.2.4).

    Args:
        dataset: (M, H, W) of uint16 with these filters, in chunks of one image.
        index: of the image.
        image: (H, W).
    """
    low, high = np.ascontiguousarray(image.astype("<u2").view(np.uint8).reshape(-1, 2).T)
    keep, shrink = (zlib.compressobj(level, wbits=_RAW) for level in (0, 1))
    stream = [_ZLIB_HEAD, keep.compress(low), keep.flush(zlib.Z_FULL_FLUSH), shrink.compress(high), shrink.flush()]
    checksum = zlib.adler32(high, zlib.adler32(low))
    dataset.id.write_direct_chunk((index, 0, 0), b"".join(stream) + checksum.to_bytes(4, "big"))


class NewFile(ExitStack):
    """A file to write; the same writes make the same bytes.

    Attributes:
        file: h5py's; create datasets with ``track_times=False``.
        check: raises the OSError of an earlier write; the end of the ``with`` block raises it as well.
    """

    def __init__(self, path: Path):
        """Raises OSError if the file cannot be opened."""
        super().__init__()
        sink = FileSink(path, "w+")
        self.file = h5py.File(sink, "w", libver="v110")
        self.check = sink.check
        for last_first in (sink.check, sink.close, self.file.close):
            self.callback(last_first)


class FileSink(io.FileIO):
    """A file for HDF5 to write to, which keeps the first error.

    If a disk is full, HDF5 itself drops data without an error when it flushes its cache.
    """

    _error: OSError | None = None

    def check(self) -> None:
        """Raise the first error of a write."""
        if self._error is not None:
            raise self._error

    def write(self, data: Any) -> int:
        """Write all data; after an error write nothing more."""
        view = memoryview(data).cast("B")
        written = 0
        try:
            while self._error is None and written < len(view):
                written += super().write(view[written:])
        except OSError as error:
            self._error = error
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """Truncate the file, or extend it with zeros."""
        try:
            return super().truncate(size)
        except OSError as error:
            self._error = self._error or error
            return 0


def open_file(path: Path) -> h5py.File:
    """Open a file to read.

    Raises:
        InputError: it is missing, no HDF5 file, damaged, or forged: on some such files HDF5's library hangs, and
            others fill all memory when they are unpacked.
    """
    check_regular(path)
    if (said := answer_apart(lambda: _looked_through(path), SECONDS, MEMORY)) != GOOD:
        raise InputError(f"{path}: {said or 'damaged: HDF5 takes too much time or memory to read it'}")
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise InputError(f"{path}: not a readable HDF5 file") from error


def _looked_through(path: Path) -> str:
    """What is wrong with a file's attributes, datasets and chunk indices, without the data; else :data:`GOOD`."""
    try:
        with h5py.File(path, "r") as file:
            dict(file.attrs)
            file.visititems(_check_chunks)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        return f"not a readable HDF5 file: {' '.join(str(error).split())}"
    return GOOD


def _check_chunks(name: str, part: h5py.Dataset | h5py.Group) -> None:
    """Raises ValueError if a dataset's chunks are longer than incompressible data would be."""
    if isinstance(part, h5py.Dataset) and part.chunks:
        most, longest = 1.1 * prod(part.chunks) * part.id.get_type().get_size() + 1024, 0

        def see(chunk: h5py.h5d.StoreInfo) -> None:
            nonlocal longest
            longest = max(longest, chunk.size)

        part.id.chunk_iter(see)
        if longest > most:
            raise ValueError(f"{name} has a chunk of {longest} bytes; at most {most:.0f} are possible")
