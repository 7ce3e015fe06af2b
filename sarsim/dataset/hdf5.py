"""HDF5 files, for which all write errors are reported, and which are checked before they are read."""

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
from pipeline.files import NO_ERROR, check_regular, run_isolated

FAST_COMPRESSION = {"compression": "gzip", "compression_opts": 1}
"""Options for fast compression. HDF5's other fast filter, LZF, does not give the same bytes for the same data."""
CHECK_SECONDS, CHECK_MEMORY = 3, 1_000_000_000
"""Limits of processor time, s, and memory, bytes, for checking a file; sarsim's files need 0.01 s and a few MB."""
_RAW_WBITS = -15  # zlib's ``wbits`` for a stream without header and checksum, with the largest window
_ZLIB_HEAD = b"\x78\x01"  # RFC 1950: deflate, the largest window, fastest


def write_noisy(dataset: h5py.Dataset, index: int, image: NDArray[np.uint16]) -> None:
    """Write one image in the format of the shuffle and gzip filters, but in a fifth of the time that they take.

    The low bytes of a noisy image hardly compress, so the stream stores them uncompressed (RFC 1951, 3.2.4).

    Args:
        dataset: (M, H, W) uint16 with these filters, in chunks of one image.
        index: index of the image.
        image: (H, W) pixel values.
    """
    low, high = np.ascontiguousarray(image.astype("<u2").view(np.uint8).reshape(-1, 2).T)
    keep, shrink = (zlib.compressobj(level, wbits=_RAW_WBITS) for level in (0, 1))
    stream = [_ZLIB_HEAD, keep.compress(low), keep.flush(zlib.Z_FULL_FLUSH), shrink.compress(high), shrink.flush()]
    checksum = zlib.adler32(high, zlib.adler32(low))
    dataset.id.write_direct_chunk((index, 0, 0), b"".join(stream) + checksum.to_bytes(4, "big"))


class NewFile(ExitStack):
    """A new HDF5 file; the same writes give the same bytes.

    Attributes:
        file: h5py's file; create datasets with ``track_times=False``.
        check: function that raises the OSError of an earlier write; the end of the ``with`` block also raises it.
    """

    def __init__(self, path: Path):
        """Create the file; OSError if that fails."""
        super().__init__()
        sink = CheckedFile(path, "w+")
        self.file = h5py.File(sink, "w", libver="v110")
        self.check = sink.check
        for last_first in (sink.check, sink.close, self.file.close):
            self.callback(last_first)


class CheckedFile(io.FileIO):
    """A file for HDF5 to write to, which remembers the first error.

    If the disk is full, HDF5 itself loses data without an error when it flushes its cache.
    """

    _error: OSError | None = None

    def check(self) -> None:
        """Raise the first error of a write."""
        if self._error is not None:
            raise self._error

    def write(self, data: Any) -> int:
        """Write all data, or nothing after an error."""
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
    """Open a file for reading.

    Raises:
        InputError: the file is missing, not HDF5, damaged or malicious; some such files make HDF5's library hang or
            fill all memory.
    """
    check_regular(path)
    if (said := run_isolated(_check_file, path, seconds=CHECK_SECONDS, memory=CHECK_MEMORY)) != NO_ERROR:
        limits = f"{CHECK_SECONDS} s or {CHECK_MEMORY / 1e9:g} GB"
        raise InputError(f"{path}: {said or f'damaged: HDF5 crashed or needed more than {limits} to read it'}")
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise InputError(f"{path}: not a readable HDF5 file") from error


def _check_file(path: Path) -> str:
    """The error in a file's attributes, datasets or chunk indices, or :data:`NO_ERROR`; the data are not read."""
    try:
        with h5py.File(path, "r") as file:
            dict(file.attrs)
            file.visititems(_check_chunks)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        return f"not a readable HDF5 file: {' '.join(str(error).split())}"
    return NO_ERROR


def _check_chunks(name: str, part: h5py.Dataset | h5py.Group) -> None:
    """Raise ValueError if a dataset has a chunk longer than incompressible data would make it."""
    if isinstance(part, h5py.Dataset) and part.chunks:
        most, longest = 1.1 * prod(part.chunks) * part.id.get_type().get_size() + 1024, 0

        def see(chunk: h5py.h5d.StoreInfo) -> None:
            nonlocal longest
            longest = max(longest, chunk.size)

        part.id.chunk_iter(see)
        if longest > most:
            raise ValueError(f"{name} has a chunk of {longest} bytes; the limit is {most:.0f} bytes")
