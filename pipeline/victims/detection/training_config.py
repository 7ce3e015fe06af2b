"""Settings of the victim detector's training; they can be read without loading PyTorch."""

from dataclasses import dataclass

from pipeline.semantic_map.networks.training_config import Optimization, TrainingConfig


@dataclass(frozen=True, kw_only=True)
class YoloOptimization(Optimization):
    """How a training follows the gradients, which are noisy, and steep at first."""

    weight_decay_of_vectors: float = 0.0
    most_gradient: float | None = 10.0
    averaging: float | None = 0.998


@dataclass(frozen=True, kw_only=True)
class CanvasAugmentation:
    """How random canvases differ from the images.

    Attributes:
        odds: probability of each change: drawing an image without people, a mosaic of four images (Bochkovskiy et
            al., YOLOv4, arXiv:2004.10934), pasting the people of another image, and mirroring.
        variation: maximum factor of an image's size, relative to the size that just fits its part of the canvas, and
            of its saturation and brightness (Darknet's ``saturation`` and ``exposure``); the minimum is the inverse.
        hue: maximum shift of the hue, 256ths of the circle.
        visible: minimum share of a box that must not be cut off or pasted over for its person to count.
    """

    odds: float = 0.5
    variation: float = 1.5
    hue: int = 13
    visible: float = 0.3


@dataclass(frozen=True, kw_only=True)
class YoloTrainingConfig(TrainingConfig):
    """Settings of a training.

    Attributes:
        width: width of the network's input in pixels, a multiple of 32; with larger inputs, the network finds smaller
            people but is slower.
        height: height of the network's input in pixels, a multiple of 32.
        prior: objectness before training (Lin et al., RetinaNet, arXiv:1708.02002, section 3.3); average precision
            counts no detection of less.
        augmentation: how canvases differ from the images.
    """

    width: int = 512
    height: int = 384
    steps: int = 6000
    batch: int = 16
    validate_every: int = 500
    prior: float = 0.01
    augmentation: CanvasAugmentation = CanvasAugmentation()
    optimization: YoloOptimization = YoloOptimization()
