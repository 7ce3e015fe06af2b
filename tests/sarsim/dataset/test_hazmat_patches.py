"""Patches that the network of hazmat signs is trained on."""

import numpy as np

from pipeline.finds.hazmat_classes import HAZMAT_CLASSES
from sarsim.dataset.hazmat_patches import PatchSource, patches


def test_patches_of_every_class_leave_the_labels_of_the_source_unworn() -> None:
    rng = np.random.default_rng(3)
    source = PatchSource.make(1, [rng.integers(0, 256, (240, 320, 3), np.uint8)], rng)
    before = [squares.copy() for squares in source.squares]
    images, kinds = patches(source, 300, rng)
    assert images.dtype == np.uint8 and len(images) == 300
    assert set(kinds) == {*range(len(HAZMAT_CLASSES) + 1)}
    for squares, unworn in zip(source.squares, before, strict=True):
        np.testing.assert_array_equal(squares, unworn)
