"""Class probabilities in two bytes."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.semantic_map.top_two_classes import TopTwoClasses


def test_the_two_most_probable_classes_share_the_whole():
    shares = TopTwoClasses.of(
        np.float32([(0.1, 0.6, 0, 0, 0, 0, 0.3, 0), (0, 0, 1, 0, 0, 0, 0, 0), np.full(8, 1 / 8)])
    )
    expected = [(0, 170, 0, 0, 0, 0, 85, 0), (0, 0, 255, 0, 0, 0, 0, 0), (128, 127, 0, 0, 0, 0, 0, 0)]
    np.testing.assert_array_equal(shares.probabilities, expected)
    assert shares.nbytes == 9


@given(st.lists(st.lists(st.floats(0, 1, width=32), min_size=8, max_size=8), max_size=20))
def test_the_most_probable_class_stays_and_shares_sum_to_the_whole(rows):
    probabilities = np.array(rows, np.float32).reshape(-1, 8)
    kept = TopTwoClasses.of(probabilities)
    np.testing.assert_array_equal(kept.classes[:, 0], probabilities.argmax(axis=1))
    assert (kept.probabilities.sum(axis=1, dtype=int)[probabilities.any(axis=1)] == 255).all()
