"""Networks as ONNX files, batch normalization folded in. Field numbers are those of onnx.proto3 (opset 13)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.files import whole_file
from pipeline.victims.detection.darknet_cfg import Convolutional, Maxpool, Route, Shortcut, Upsample, Yolo
from pipeline.victims.detection.folding import folded
from pipeline.victims.detection.network import LEAKY_SLOPE, DarknetConvolution, DarknetMaxpool, DarknetNetwork
from pipeline.victims.detection.protobuf import decimal, message, text, whole

INPUT = "images"
_IR_VERSION, _OPSET = 7, 13
_FLOAT = 1  # TensorProto.DataType
_ATTRIBUTE_FLOAT, _ATTRIBUTE_INT, _ATTRIBUTE_STRING, _ATTRIBUTE_INTS = (
    1,
    2,
    3,
    7,
)  # AttributeProto.AttributeType


def write_onnx(path: Path, network: DarknetNetwork) -> None:
    """Write a network.

    Its input ``images`` is (1, C, H, W) float32 of 0 to 1, its outputs ``yolo_<layer>`` are what goes into each
    [yolo].

    Raises:
        InputError: the file cannot be written.
    """
    with whole_file(path) as file:
        file.write_bytes(onnx_bytes(network))


def onnx_bytes(network: DarknetNetwork) -> bytes:
    """The file's content."""
    graph = message(7, _Graph(network).content)
    opset = message(8, text(1, ""), whole(2, _OPSET))
    return whole(1, _IR_VERSION) + text(2, "sarsim") + graph + opset


class _Graph:
    """Nodes, constants, inputs and outputs, gathered layer by layer."""

    def __init__(self, network: DarknetNetwork) -> None:
        cfg = network.cfg
        self._nodes = self._constants = self._outputs = b""
        names: list[str] = []
        before = INPUT
        for index, layer in enumerate(cfg.layers):
            match layer, network.layers[index]:
                case Convolutional(), DarknetConvolution() as module:
                    before = self._convolution(layer, module, before, f"conv_{index}")
                case Maxpool(), DarknetMaxpool() as module:
                    before = self._maxpool(module, before, f"max_{index}")
                case Upsample(), _:
                    before = self._upsample(layer, before, f"up_{index}")
                case Route(), _:
                    sources = [names[i] for i in layer.layers]
                    before = self._node("Concat", sources, f"route_{index}", axis=1)
                case Shortcut(), _:
                    before = self._node("Add", [before, names[layer.layer]], f"add_{index}")
                case Yolo(), _:
                    before = self._node("Identity", [before], f"yolo_{index}")
                    self._outputs += message(12, _value(before, network.shapes[index]))
            names.append(before)
        inputs = message(11, _value(INPUT, (cfg.channels, cfg.height, cfg.width)))
        self.content = self._nodes + text(2, "yolov3") + self._constants + inputs + self._outputs

    def _convolution(self, layer: Convolutional, module: DarknetConvolution, before: str, name: str) -> str:
        kernel, bias = (self._constant(f"{name}.{i}", t.cpu().numpy()) for i, t in enumerate(folded(module)))
        window = {
            "kernel_shape": [layer.size] * 2,
            "strides": [layer.stride] * 2,
            "pads": [layer.padding] * 4,
        }
        result = self._node("Conv", [before, kernel, bias], name, **window)
        return (
            self._node("LeakyRelu", [result], f"{name}.leaky", alpha=LEAKY_SLOPE) if module.leaky else result
        )

    def _maxpool(self, module: DarknetMaxpool, before: str, name: str) -> str:
        left, right, top, bottom = module.margins
        window = {"kernel_shape": [module.size] * 2, "strides": [module.stride] * 2}
        return self._node(
            "MaxPool", [before], name, **window, pads=[top, left, max(bottom, 0), max(right, 0)]
        )

    def _upsample(self, layer: Upsample, before: str, name: str) -> str:
        scales = self._constant(f"{name}.scales", np.array([1, 1, layer.stride, layer.stride], np.float32))
        how = {"mode": "nearest", "coordinate_transformation_mode": "asymmetric", "nearest_mode": "floor"}
        return self._node("Resize", [before, "", scales], name, **how)

    def _constant(self, name: str, values: NDArray[np.float32]) -> str:
        dims = b"".join(whole(1, extent) for extent in values.shape)
        raw = message(9, values.astype("<f4").tobytes())
        self._constants += message(5, dims, whole(2, _FLOAT), text(8, name), raw)
        return name

    def _node(
        self, kind: str, inputs: Sequence[str], output: str, **attributes: int | float | str | list[int]
    ) -> str:
        fields = [text(1, name) for name in inputs] + [text(2, output), text(3, output), text(4, kind)]
        fields += [message(5, _attribute(name, value)) for name, value in attributes.items()]
        self._nodes += message(1, *fields)
        return output


def _attribute(name: str, value: int | float | str | list[int]) -> bytes:
    if isinstance(value, list):
        content = b"".join(whole(8, number) for number in value) + whole(20, _ATTRIBUTE_INTS)
    elif isinstance(value, str):
        content = text(4, value) + whole(20, _ATTRIBUTE_STRING)
    elif isinstance(value, float):
        content = decimal(2, value) + whole(20, _ATTRIBUTE_FLOAT)
    else:
        content = whole(3, value) + whole(20, _ATTRIBUTE_INT)
    return text(1, name) + content


def _value(name: str, shape: tuple[int, int, int]) -> bytes:
    """A float32 tensor of a batch of one."""
    dims = message(2, *(message(1, whole(1, extent)) for extent in (1, *shape)))
    return text(1, name) + message(2, message(1, whole(1, _FLOAT), dims))
