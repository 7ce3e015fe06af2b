"""Arrays that grow, against lists."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.localisation.growing import GrowingArray


@given(st.lists(st.lists(st.floats(-9, 9), max_size=40), max_size=8))
def test_all_rows_are_kept_in_order(parts: list[list[float]]) -> None:
    array = GrowingArray()
    for part in parts:
        array.extend(part)
    expected = [value for part in parts for value in part]
    assert len(array) == len(expected)
    np.testing.assert_array_equal(array.values, expected)


def test_rows_that_somebody_keeps_stay() -> None:
    array = GrowingArray(2)
    array.append([1, 2])
    kept = array.values
    array.values = [[3, 4]]
    array.append([5, 6])
    np.testing.assert_array_equal(kept, [[1, 2]])
    np.testing.assert_array_equal(array.values, [[3, 4], [5, 6]])
