import numpy as np

from pipeline.metric_map.packed_depth import FARTHEST, STEP, pack_depth, unpack_depth, unpack_returns

DEPTH = np.array([[0.5, 6.5, 6.6, 12.0], [np.inf, np.nan, -1.0, 0.0]], np.float32)


def test_depths_are_kept_to_a_tenth_of_a_millimetre_and_far_ones_as_far():
    expected = [[0.5, 6.5, FARTHEST * STEP, FARTHEST * STEP], [0, 0, 0, 0]]
    np.testing.assert_allclose(unpack_depth(pack_depth(DEPTH)), expected, atol=STEP / 2 + 1e-6)


def test_what_is_too_far_to_tell_where_is_no_return():
    np.testing.assert_allclose(unpack_returns(pack_depth(DEPTH)), [[0.5, 6.5, 0, 0], [0, 0, 0, 0]], atol=1e-4)
