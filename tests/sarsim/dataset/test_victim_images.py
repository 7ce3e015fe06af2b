"""Frames of a dataset as images to learn from."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from sarsim.dataset.victim_images import VictimImages
from tests.sarsim.dataset.people_dataset import write_people_dataset
from tests.sarsim.dataset.small import frame


@pytest.fixture
def data(tmp_path: Path) -> Path:
    write_people_dataset(tmp_path)
    return tmp_path


def test_frames_come_with_their_boxes(data: Path) -> None:
    images = VictimImages([data], "train")
    assert len(images) == 4 * 4
    first, second, third, fourth = (images[4 + i] for i in range(4))  # scene 1
    np.testing.assert_array_equal(second.rgb, frame(1).frame.rgb)
    np.testing.assert_array_equal(first.boxes, [[1, 2, 4, 4], [0, 1, 6, 4]])
    assert first.ignored.tolist() == [False, True]
    assert second.ignored.tolist() == [False]
    np.testing.assert_array_equal(first.shown, frame(0).frame.label == 6)
    assert len(third.boxes) == 0
    assert third.shown is None
    assert fourth.ignored.tolist() == [True]
    images.close()


def test_sizes_are_those_of_the_people_to_be_found(data: Path) -> None:
    images = VictimImages([data], "train")
    np.testing.assert_allclose(images.people(4), [[3 / 8, 2 / 6]])
    np.testing.assert_allclose(images.people(5), [[6 / 8, 3 / 6]])
    assert [len(images.people(i)) for i in (6, 7)] == [0, 0]


def test_splits_and_strides(data: Path) -> None:
    assert len(VictimImages([data], "val")) == 4
    assert len(VictimImages([data], "test")) == 0
    assert len(VictimImages([data, data], "val")) == 8
    strided = VictimImages([data], "train", stride=3)
    assert len(strided) == 4 * 2
    np.testing.assert_array_equal(strided[1].rgb, frame(3).frame.rgb)


def test_a_missing_scene_is_noticed(data: Path) -> None:
    (data / "scenes" / "00002.h5").unlink()
    with pytest.raises(InputError, match=r"00002\.h5"):
        VictimImages([data], "train")
