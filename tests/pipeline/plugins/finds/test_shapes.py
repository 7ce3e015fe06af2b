"""Fire extinguishers and door levers in rendered images, by the shipped classifier."""

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.plugins.finds.shapes import ShapeReader
from sarsim.assets import asset
from tests.pipeline.plugins.finds.wall_of_things import THINGS, wall_of


@pytest.fixture(scope="module")
def reader() -> ShapeReader:
    return ShapeReader.load(asset("weights", "shapes.safetensors"))


def test_both_are_recognised_and_found_where_they_are(reader: ShapeReader) -> None:
    frame = wall_of(*THINGS)
    found = {reading.kind: reading for reading in reader.read(frame)}
    assert found.keys() == {"fire_extinguisher", "door_lever"}
    scale = frame.intrinsics.fx / 2.05  # pixels per m
    for kind, right, down in (("fire_extinguisher", 0.3, 0.0), ("door_lever", -0.26, -0.02)):
        middle = np.array(found[kind].box).reshape(2, 2).mean(axis=0)
        np.testing.assert_allclose(middle, (320 + right * scale, 240 + down * scale), atol=0.1 * scale)


def test_a_block_and_a_code_are_neither(reader: ShapeReader) -> None:
    assert reader.read(wall_of("code")) == []


def test_weights_of_something_else_are_refused() -> None:
    with pytest.raises(InputError, match=r"hazmat\.safetensors: .*2 classes \([^\n]*$"):
        ShapeReader.load(asset("weights", "hazmat.safetensors"))
