"""Reads QR codes and AprilTags in an image by OpenCV; what a code says is data, and nothing is done with it."""

from collections.abc import Iterator, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.finds.find import Reading
from pipeline.finds.pictures import READ_PIXELS, bounded

FAMILY = cv2.aruco.DICT_APRILTAG_36h11
SHOWN = 40  # Most characters of what a code says in maps and lists


class CodeReader:
    """Finds QR codes and AprilTags."""

    def __init__(self) -> None:
        """With OpenCV's two decoders of QR codes, and its detector of tags."""
        self._decoders = cv2.QRCodeDetector(), cv2.QRCodeDetectorAruco()
        self._tags = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(FAMILY))

    def read(self, rgb: NDArray[np.uint8], enlarged: int = 2**2) -> list[Reading]:
        """The codes in an image, (H, W, 3) or grey (H, W) uint8, those that were decoded first.

        Codes are sought in the image as it is, and ``enlarged`` so many times at most: at 60 pixels a module of a
        small code has two, too few for the decoders, and four times as many suffice.

        Raises:
            InputError: the image is empty or of another type.
        """
        image, scale = bounded(rgb)
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)
        times = min(enlarged, 2 * (READ_PIXELS / grey.size) ** 0.5)
        larger = cv2.resize(grey, None, fx=times, fy=times, interpolation=cv2.INTER_CUBIC)
        found = [*self._read_tags(grey, scale)]
        for picture, zoom in ((grey, scale), (larger, scale * times)):
            found += self._read_codes(np.asarray(picture, np.uint8), zoom)
        return _distinct(sorted(found, key=lambda reading: -reading.confidence))

    def _read_tags(self, grey: NDArray[np.uint8], scale: float) -> Iterator[Reading]:
        corners, ids, _ = self._tags.detectMarkers(grey)
        for quad, number in zip(corners, () if ids is None else ids.ravel().tolist(), strict=True):
            yield Reading("april_tag", str(number), (quad.reshape(4, 2) / scale).astype(np.float32), 1.0)

    def _read_codes(self, grey: NDArray[np.uint8], scale: float) -> Iterator[Reading]:
        """Codes, those that were located but not decoded too: they are to be looked at from nearer."""
        for decoder in self._decoders:
            for text, quad in _decoded(decoder, grey):
                yield Reading("qr_code", text, (quad / scale).astype(np.float32), 1.0 if text else 0.5)


def _decoded(decoder: Any, grey: NDArray[np.uint8]) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """What codes say, and their (4, 2) corners; what OpenCV fails at was not read."""
    try:
        _, texts, quads, _ = decoder.detectAndDecodeMulti(grey)
    except (cv2.error, UnicodeDecodeError):
        return
    for text, quad in zip(texts, () if quads is None else quads, strict=True):
        if np.isfinite(quad).all() and cv2.contourArea(quad.astype(np.float32)) > 1:
            yield text, quad


def _distinct(readings: Sequence[Reading]) -> list[Reading]:
    """The readings of which none has its middle within an earlier one of the same kind."""
    kept: list[Reading] = []
    for reading in readings:
        middle = reading.corners.mean(axis=0).tolist()
        others = (other for other in kept if other.kind == reading.kind)
        if all(cv2.pointPolygonTest(cv2.convexHull(other.corners), middle, False) < 0 for other in others):
            kept.append(reading)
    return kept


def plain_text(text: str, most: int = SHOWN) -> str:
    """What a code says on one line of printable characters, ``most`` at most; what is cut ends with "…"."""
    shown = "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text[: most + 1])
    return shown if len(shown) <= most else shown[: most - 1] + "…"
