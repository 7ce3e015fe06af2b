"""Read QR codes and AprilTags in an image with OpenCV; the content of a code is stored but never acted upon."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pixels
from pipeline.plugins.finds.config import CodesConfig
from pipeline.plugins.finds.squares import Pyramid, SquareCandidates, corners_in, rectified
from pipeline.tracks.find import Reading, is_same

TAG_FAMILY = cv2.aruco.DICT_APRILTAG_36h11


class CodeReader:
    """Finds QR codes and AprilTags."""

    def __init__(self, config: CodesConfig = CodesConfig()) -> None:
        """Use OpenCV's two decoders of QR codes, and its detector of tags.

        The decoder based on ArUco takes a quarter of the other decoder's time per image, but it reads fewer rectified
        codes.
        """
        self._config = config
        self._in_images, self._in_squares = cv2.QRCodeDetectorAruco(), cv2.QRCodeDetector()
        self._tags = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(TAG_FAMILY))

    def read(self, squares: SquareCandidates) -> list[Reading]:
        """The codes in an image, decoded codes first.

        QR codes are searched for in the image, and in rectified squares whose grey levels change as much as those of
        a code. In the image, decoders cannot read codes that are seen obliquely or whose modules are smaller than
        about three pixels.
        """
        grey = np.asarray(cv2.cvtColor(squares.image, cv2.COLOR_RGB2GRAY), np.uint8)
        pyramid, found = Pyramid(grey), [*self._read_tags(grey), *self._read_codes(self._in_images, grey)]
        for quad in squares.quads:
            is_read = any(reading.text and is_same(reading.corners, quad) for reading in found)
            if not is_read and self._may_be_code(rectified(pyramid, quad, self._config.checked_side)):
                found += self._read_rectified(pyramid, quad)
        found = [replace(reading, corners=reading.corners / np.float32(squares.scale)) for reading in found]
        return _distinct(sorted(found, key=lambda reading: -reading.confidence))

    def _read_tags(self, grey: NDArray[np.uint8]) -> Iterator[Reading]:
        corners, ids, _ = self._tags.detectMarkers(grey)
        for quad, number in zip(corners, () if ids is None else ids.ravel().tolist(), strict=True):
            yield Reading("april_tag", str(number), quad.reshape(4, 2).astype(np.float32), 1.0)

    def _read_codes(self, decoder: Any, grey: NDArray[np.uint8]) -> Iterator[Reading]:
        """Codes, including undecoded ones, which the robot should view from a shorter distance."""
        for text, quad in _decoded(decoder, grey, self._config.min_area):
            yield Reading("qr_code", text, quad.astype(np.float32), 1.0 if text else self._config.undecoded)

    def _may_be_code(self, patch: NDArray[np.uint8]) -> bool:
        """Whether grey levels along the rows and columns of a patch change as much as in a code."""
        grey = patch.astype(np.float32) / np.iinfo(np.uint8).max
        changes = np.mean([np.abs(np.diff(grey, axis=k)).sum(axis=k).mean() for k in (0, 1)])
        return bool(changes > self._config.changes)

    def _read_rectified(self, pyramid: Pyramid, quad: Pixels) -> Iterator[Reading]:
        """The codes in a rectified quadrilateral."""
        side = self._config.read_side
        patch = rectified(pyramid, quad, side, cv2.INTER_CUBIC)
        T = cv2.getPerspectiveTransform(corners_in(side), quad)
        for code in self._read_codes(self._in_squares, patch):
            yield replace(code, corners=np.asarray(cv2.perspectiveTransform(code.corners[None], T)[0], np.float32))


def _decoded(decoder: Any, grey: NDArray[np.uint8], min_area: float) -> Iterator[tuple[str, Pixels]]:
    """The texts of codes, and their four corners; none if OpenCV fails."""
    try:
        _, texts, quads, _ = decoder.detectAndDecodeMulti(grey)
    except (cv2.error, UnicodeDecodeError):
        return
    for text, quad in zip(texts, () if quads is None else quads, strict=True):
        if np.isfinite(quad).all() and cv2.contourArea(quad.astype(np.float32)) > min_area:
            yield text, quad


def _distinct(readings: Sequence[Reading]) -> list[Reading]:
    """The readings whose centres are not within earlier readings of the same kind."""
    kept: list[Reading] = []
    for reading in readings:
        middle = reading.corners.mean(axis=0).tolist()
        others = (other for other in kept if other.kind == reading.kind)
        if all(cv2.pointPolygonTest(cv2.convexHull(other.corners), middle, False) < 0 for other in others):
            kept.append(reading)
    return kept
