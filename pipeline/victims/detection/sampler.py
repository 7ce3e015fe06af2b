"""Canvases to learn from, by number."""

from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.errors import InputError
from pipeline.victims.detection.augmentation import AugmentationConfig, augmented
from pipeline.victims.detection.exposure import evenly_exposed
from pipeline.victims.detection.labelled_image import LabelledImage, LabelledImages


@dataclass(frozen=True)
class SamplingConfig:
    """How canvases are made.

    Attributes:
        batch: canvases in a batch.
        empty: share of the images drawn that show no one.
        augmentation: of the images.
    """

    batch: int = 16
    empty: float = 0.3
    augmentation: AugmentationConfig = field(default_factory=AugmentationConfig)

    def __post_init__(self) -> None:
        """Refuse what cannot be done."""
        if self.batch < 1 or not 0 <= self.empty < 1:
            raise InputError("--sampling.batch: at least 1; --sampling.empty: a share, less than 1")


class CanvasSampler:
    """Draws canvases; the one of a number is always the same."""

    def __init__(
        self, images: LabelledImages, size: tuple[int, int], config: SamplingConfig, seed: int
    ) -> None:
        """From images, as canvases of ``size`` (width, height) pixels.

        Raises:
            InputError: no one is to be found in any image.
        """
        self._images, self._size, self._config, self._seed = images, size, config, seed
        shown = np.array([len(images.people(index)) > 0 for index in range(len(images))], bool)
        self._shown, self._empty = np.flatnonzero(shown), np.flatnonzero(~shown)
        if len(self._shown) == 0:
            raise InputError("no one is to be found in the images to train with")

    def batch(self, number: int) -> list[LabelledImage]:
        """The batch of that number."""
        first = number * self._config.batch
        return [self._canvas(first + i) for i in range(self._config.batch)]

    def _canvas(self, number: int) -> LabelledImage:
        augmentation, rng = self._config.augmentation, np.random.default_rng([self._seed, number])
        count = 4 if rng.random() < augmentation.mosaic else 1
        images = [self._image(self._draw(rng)) for _ in range(count)]
        pasted = [rng.choice(self._shown)] if rng.random() < augmentation.paste else []
        donors = [self._image(int(index)) for index in pasted]
        return augmented(images, donors, self._size, augmentation, rng)

    def _image(self, index: int) -> LabelledImage:
        """As the detector shows it to the network."""
        image = self._images[index]
        return replace(image, rgb=evenly_exposed(image.rgb))

    def _draw(self, rng: np.random.Generator) -> int:
        empty = len(self._empty) > 0 and rng.random() < self._config.empty
        return int(rng.choice(self._empty if empty else self._shown))
