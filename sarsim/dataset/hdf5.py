"""HDF5 files that are written whole or fail aloud, and read with one line for what is wrong."""

import io
import zlib
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

FAST = {"compression": "gzip", "compression_opts": 1}
"""HDF5's other fast filter, LZF, makes other bytes of the same data each time."""
_RAW = -15  # zlib's word for a stream without head and checksum, with the largest window
_ZLIB_HEAD = b"\x78\x01"  # RFC 1950: deflate, the largest window, fastest


def write_noisy(dataset: h5py.Dataset, index: int, image: NDArray[np.uint16]) -> None:
    """Write one image as the filters shuffle and gzip would, in a fifth of their time.

    The low bytes of a noisy image hardly shrink, so they stand in gzip's stream as they are (RFC 1951, 3.2.4).

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
        check: raises the OSError of an earlier write, as the end of the ``with`` block does.
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
    """A file for HDF5 to write to, which keeps what went wrong.

    Where a disk is full, HDF5 itself drops data without a word when it empties its cache.
    """

    _error: OSError | None = None

    def check(self) -> None:
        """Raise the first error of a write."""
        if self._error is not None:
            raise self._error

    def write(self, data: Any) -> int:
        """Write all of it; after an error write nothing any more."""
        view = memoryview(data).cast("B")
        written = 0
        try:
            while self._error is None and written < len(view):
                written += super().write(view[written:])
        except OSError as error:
            self._error = error
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """Cut off or extend with zeros."""
        try:
            return super().truncate(size)
        except OSError as error:
            self._error = self._error or error
            return 0


def open_file(path: Path) -> h5py.File:
    """A file to read; InputError where it is missing or no HDF5 file."""
    try:
        return h5py.File(path, "r")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: not a readable HDF5 file") from error
