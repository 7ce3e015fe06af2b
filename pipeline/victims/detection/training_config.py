"""Settings of a training of the victim detector; they can be read without loading PyTorch."""

from dataclasses import dataclass
from typing import Literal

from pipeline.semantic_map.networks.training_config import TrainingConfig


@dataclass(frozen=True, kw_only=True)
class YoloTrainingConfig(TrainingConfig):
    """Settings of a training; ``seed`` also seeds the fit of the anchors.

    Attributes:
        network: architecture; larger ones find more victims and take longer per frame.
        width: input width of the network, pixels, a multiple of its stride of 32; larger ones find smaller people and
            take longer.
        height: input height of the network, pixels, a multiple of its stride.
    """

    network: Literal["yolov3-small", "yolov3-tiny", "yolov3"] = "yolov3-small"
    width: int = 512
    height: int = 384
    steps: int = 6000
    batch: int = 16
    validate_every: int = 500
