"""Detectors of the YOLO family in ONNX files, as the usual training programs export them."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np

from pipeline.errors import InputError
from pipeline.files import check_hash, read_bytes
from pipeline.victims.boxes import ScoredBoxes
from pipeline.victims.opencv_network import OpenCvNetwork, checked_network, kinds_of

GRIDS = (8, 16, 32), (8, 16, 32, 64), (4, 8, 16, 32)
"""Pixels per cell of the grids that detectors of the YOLO family have."""
ANCHORS = 3
"""Number of boxes per cell of YOLOv5; YOLOv8 and later versions have one box per cell."""
EXPORT = "yolo export model=FILE.pt format=onnx opset=17 dynamic=False nms=False end2end=False"
"""The command of Ultralytics that exports a network in a form that OpenCV reads."""
REMEDY = f"; export it without end-to-end detection and without NMS: {EXPORT}"


class OnnxNetwork(OpenCvNetwork):
    """A detector with a box for each cell of its grids, in the layout of YOLOv5, or of v8, v9 and v11."""

    def __init__(self, content: bytes, size: tuple[int, int]) -> None:
        """Read the network from the content of its file; cv2.error if OpenCV cannot read it."""
        self.net = cv2.dnn.readNetFromONNX(np.frombuffer(content, np.uint8))
        self.size = size
        self.outputs = self.net.getUnconnectedOutLayersNames()[:1]
        self.kinds = {}
        self._is_v8: bool | None = None

    @classmethod
    def load(cls, path: Path, names: Sequence[str], where: str) -> Self:
        """Read a network; ``names``: names of the network's classes, which come from the file ``where``.

        Raises:
            InputError: the file is missing or damaged, OpenCV cannot run the network, the network's output has
                another layout, or none of its classes is known.
        """
        check_hash(path)
        content = read_bytes(path)
        network = checked_network(str(path), partial(cls, content, input_size(content, path)), REMEDY)
        network.kinds = kinds_of(path, network.layout()[1], names, where)
        return network

    def check(self) -> None:
        """See :meth:`OpenCvNetwork.check`."""
        self.layout()

    def layout(self) -> tuple[bool, int]:
        """Whether boxes are columns of the output, as in YOLOv8, rather than rows, and the number of classes.

        Raises:
            InputError: the output has neither layout; for example, an end-to-end network has a row for each of 300
                detections.
        """
        ids, _, shapes = self.net.getLayersShapes([1, 3, *self.size[::-1]])
        last = list(ids).index(self.net.getUnconnectedOutLayers()[0])
        shape = tuple(map(int, shapes[last][0]))
        width, height = self.size
        cells = {sum((width // stride) * (height // stride) for stride in strides) for strides in GRIDS}
        if len(shape) == 3 and shape[1] > 4 and shape[2] in cells:
            return True, shape[1] - 4
        if len(shape) == 3 and shape[2] > 5 and shape[1] in {ANCHORS * count for count in cells}:
            return False, shape[2] - 5
        raise InputError(
            f"its output has the shape {shape}, but must have (1, 4 + classes, N) or (1, {ANCHORS} N, 5 + classes), "
            f"where N is the number of cells in all grids{REMEDY}"
        )

    def decode(self, outputs: Sequence[Any]) -> ScoredBoxes:
        """See :meth:`OpenCvNetwork.decode`."""
        (rows,) = outputs[0]
        if self._is_v8 is None:
            self._is_v8, _ = self.layout()
        if self._is_v8:
            rows = rows.T
            scores = rows[:, 4:]
        else:
            scores = rows[:, 5:] * rows[:, 4:5]
        middle = rows[:, :2]
        half = rows[:, 2:4] / 2
        return np.concatenate([middle - half, middle + half], axis=1), scores


def input_size(content: bytes, path: Path) -> tuple[int, int]:
    """Width and height of the first input of an ONNX file, pixels, which OpenCV reads but does not return.

    Raises:
        InputError: the content is not an ONNX file, or the network's input is not a colour image of a fixed size.
    """
    try:
        message: Any = content
        # ModelProto.graph, GraphProto.input, ValueInfoProto.type, TypeProto.tensor_type, Tensor.shape
        for number in (7, 11, 2, 1, 2):
            message = next(value for found, value in _fields(message) if found == number)
        sizes = [dict(_fields(value)).get(1) for _, value in _fields(message)]  # Dimension.dim_value
    except (IndexError, StopIteration, TypeError, ValueError) as error:
        raise InputError(f"{path}: not an ONNX file with a network; use another file") from error
    match sizes:
        case [1, 3, int(height), int(width)] if 0 < height < 2**16 and 0 < width < 2**16:
            return width, height
    raise InputError(f"{path}: the input must be one colour image of a fixed size; export it with {EXPORT}")


def _fields(message: bytes) -> Iterator[tuple[int, Any]]:
    """Yield the number and value (int or bytes) of each field of a message in protobuf's wire format.

    Raises:
        IndexError, ValueError: the bytes are not such a message.
    """
    at = 0

    def whole_number() -> int:
        nonlocal at
        result = shift = 0
        while shift < 64:
            byte = message[at]
            at += 1
            result |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return result
        raise ValueError

    while at < len(message):
        number, kind = divmod(whole_number(), 8)
        if kind == 0:
            yield number, whole_number()
            continue
        length = {1: 8, 5: 4}.get(kind) or whole_number()
        if kind not in (1, 2, 5) or at + length > len(message):
            raise ValueError
        yield number, message[at : at + length]
        at += length
