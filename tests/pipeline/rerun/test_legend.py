"""The picture that says what colours mean."""

import numpy as np

from pipeline.labels import COLOURS, Label
from pipeline.rerun.legend import MEANINGS, legend


def test_every_colour_is_shown_with_a_meaning() -> None:
    shown = {tuple(colour) for colour in np.unique(legend().reshape(-1, 3), axis=0).tolist()}
    assert set(MEANINGS.values()) <= shown
    assert {tuple(COLOURS[label].tolist()) for label in Label} <= set(MEANINGS.values())
