"""What networks answered, kept in a folder by what they were asked: an episode driven again asks none twice."""

import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from pipeline.files import whole_file
from pipeline.frame import Frame
from pipeline.labels import Label
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.victims.detection.detection import Detection, Detector

MOST_PEOPLE = 10_000
"""Detections in an answer."""


class Answers:
    """A folder of answers, a file each, named by the digest of the question.

    Attributes:
        folder: which is made.
        recalled: how many were there already.
    """

    def __init__(self, folder: Path):
        self.folder, self.recalled = folder, 0
        folder.mkdir(exist_ok=True)

    def recall(
        self, question: Sequence[ArrayLike], kind: DTypeLike, most: int, ask: Callable[[], NDArray]
    ) -> NDArray:
        """The kept numbers of a type, at most so many, or those that ``ask`` gives, which are kept; 1D.

        Raises:
            InputError: they cannot be written.
        """
        digest = blake2b(digest_size=16)
        for part in question:
            digest.update(np.ascontiguousarray(part).data.cast("B"))
        path, size = self.folder / digest.hexdigest(), most * np.dtype(kind).itemsize
        with suppress(OSError, zlib.error, ValueError):
            stream = zlib.decompressobj()
            kept = np.frombuffer(stream.decompress(path.read_bytes(), size + 1), kind).copy()
            if stream.eof and len(kept) <= most and np.isfinite(kept).all():
                self.recalled += 1
                return kept
        answer = np.ascontiguousarray(ask(), kind).ravel()
        with whole_file(path) as partial:
            partial.write_bytes(zlib.compress(answer.tobytes(), 1))
        return answer


class RecallingClassifier:
    """A point classifier that depends on nothing but its parameters, each asked about once."""

    def __init__(self, classifier: PointClassifier, answers: Answers, weights: Path):
        self._classifier, self._answers, self._weights = classifier, answers, _content(weights)

    def classify(
        self, frame: Frame, points: NDArray[np.float32], T_map_camera: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """As :meth:`PointClassifier.classify`."""
        question = self._weights, frame.time, frame.depth, points, T_map_camera
        shape = len(points), len(Label)
        numbers = self._answers.recall(
            question, np.float32, shape[0] * shape[1], lambda: self._classifier.classify(frame, points, T_map_camera)
        )
        return numbers.reshape(shape)


class RecallingDetector:
    """A detector that is asked about each image once."""

    def __init__(self, detector: Detector, answers: Answers, *files: Path):
        """``files`` of which it was made."""
        self._detector, self._answers, self._files = detector, answers, _content(*files)

    def detect(self, rgb: NDArray[np.uint8]) -> list[Detection]:
        """As :meth:`Detector.detect`."""
        numbers = self._answers.recall(
            (self._files, rgb),
            np.float64,
            5 * MOST_PEOPLE,
            lambda: np.array([(*person.box, person.confidence) for person in self._detector.detect(rgb)]),
        )
        return [Detection((x0, y0, x1, y1), sure) for x0, y0, x1, y1, sure in numbers.reshape(-1, 5).tolist()]


def _content(*files: Path) -> NDArray[np.uint8]:
    """What tells these files from others, as a part of a question."""
    return np.frombuffer(b"".join(blake2b(path.read_bytes()).digest() for path in files), np.uint8)
