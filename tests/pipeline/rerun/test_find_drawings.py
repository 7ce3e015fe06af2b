"""The marks of finds in the recording."""

from dataclasses import replace

import numpy as np

from pipeline.rerun.find_drawings import marks
from pipeline.tracks.find import HEAT, Find

STOVE = Find(HEAT, "", np.array([1.0, 2.0, 0.5]), np.eye(3), 3.0, 0.9, np.zeros((4, 4, 3), np.uint8))


def test_heat_of_a_person_is_not_marked_on_top_of_the_persons_name():
    person = replace(STOVE, position=np.array([3.0, 2.0, 0.3]), is_heat_of_person=True)
    drawn = marks([STOVE, person])
    np.testing.assert_allclose(drawn.positions.as_arrow_array().to_pylist(), [STOVE.position])
    assert drawn.labels.as_arrow_array().to_pylist() == ["heat"]


def test_no_finds_make_no_marks():
    assert len(marks([]).positions.as_arrow_array()) == 0
