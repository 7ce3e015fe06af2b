"""A cache of the networks' outputs in a folder, keyed by the inputs, so that a repeated episode runs no network."""

import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from pipeline.arrays import Pose, Rgb
from pipeline.errors import InputError
from pipeline.files import atomic_write
from pipeline.frame import Frame
from pipeline.labels import Label
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.tracks.find import KINDS
from pipeline.victims.detection import Detection, Detector

MAX_ROWS = 3000  # Maximum number of detections in an image, so that a damaged file cannot fill the memory


class OutputCache:
    """A folder with one file per output, named by the digest of the inputs.

    Attributes:
        folder: the folder; it is created if it does not exist.
        hits: number of outputs that were read from the folder.
    """

    def __init__(self, folder: Path):
        """Create the folder; InputError if that fails."""
        self.folder, self.hits = folder, 0
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: the folder cannot be created: {error.strerror or error}") from error

    def get(
        self, inputs: Sequence[ArrayLike], kind: DTypeLike, shape: tuple[int, int], run: Callable[[], NDArray]
    ) -> NDArray:
        """Return the cached output for these inputs; if there is none, call ``run`` and cache its output.

        The output has the dtype ``kind`` and the shape ``shape`` (rows, columns); -1 rows stands for any number.

        Raises:
            InputError: the output cannot be written.
        """
        digest = blake2b()
        for part in inputs:
            digest.update(np.asarray(part).tobytes())
        path = self.folder / digest.hexdigest()
        with suppress(OSError, zlib.error, ValueError):
            stream, rows = zlib.decompressobj(), MAX_ROWS if shape[0] < 0 else shape[0]
            content = stream.decompress(path.read_bytes(), rows * shape[1] * np.dtype(kind).itemsize + 1)
            kept = np.frombuffer(content, kind).reshape(shape).copy()
            if stream.eof and np.isfinite(kept).all():
                self.hits += 1
                return kept
        output = np.asarray(run(), kind).reshape(shape)
        with atomic_write(path) as partial:
            partial.write_bytes(zlib.compress(output.tobytes(), 1))
        return output


class CachedClassifier(PointClassifier):
    """Calls a point classifier only once for the same arguments, on which alone its output must depend."""

    def __init__(self, classifier: PointClassifier, cache: OutputCache, weights: Path):
        self._classifier, self._cache, self._weights = classifier, cache, _digests(weights)

    def classify(self, frame: Frame, points: NDArray[np.float32], T_map_camera: Pose) -> NDArray[np.float32]:
        """See :meth:`PointClassifier.classify`."""
        inputs = self._weights, frame.time, frame.depth, points, T_map_camera
        shape = len(points), len(Label)
        return self._cache.get(
            inputs, np.float32, shape, lambda: self._classifier.classify(frame, points, T_map_camera)
        )


class CachedDetector:
    """Calls a detector only once for the same image."""

    def __init__(self, detector: Detector, cache: OutputCache, *files: Path):
        """``files``: the files from which the detector was loaded."""
        self._detector, self._cache, self._files = detector, cache, _digests(*files)

    def detect(self, rgb: Rgb) -> list[Detection]:
        """See :meth:`Detector.detect`; ``rgb`` is (H, W, 3)."""
        numbers = self._cache.get(
            (self._files, rgb),
            np.float64,
            (-1, 6),
            lambda: np.array([(*d.box, d.confidence, KINDS.index(d.kind)) for d in self._detector.detect(rgb)]),
        )
        return [Detection((x0, y0, x1, y1), sure, KINDS[int(k)]) for x0, y0, x1, y1, sure, k in numbers.tolist()]


def _digests(*files: Path) -> NDArray[np.uint8]:
    """The digests of the files' contents, one after the other, which serve as an input of the cache."""
    return np.frombuffer(b"".join(blake2b(path.read_bytes()).digest() for path in files), np.uint8)
