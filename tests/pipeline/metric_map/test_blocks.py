"""The unbounded array of blocks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pipeline.errors import InputError
from pipeline.metric_map.blocks import BlockArray, block_parts

SIDE = 64
"""Voxels along a side of a block."""

places = st.tuples(*[st.integers(-150, 150)] * 3).map(np.array)
boxes = hnp.arrays(np.int8, st.tuples(*[st.integers(1, 90)] * 3), elements=st.just(7), fill=st.just(7))


@given(places, boxes)
def test_what_is_written_is_read_and_nothing_else_is(lower, values):
    array = BlockArray(2**30)
    array.write(lower, values)
    around = array.read(lower - 2, tuple(side + 4 for side in values.shape))
    np.testing.assert_array_equal(around[2:-2, 2:-2, 2:-2], values)
    assert np.count_nonzero(around) == values.size
    assert [corner.tolist() for corner in array.bounds()] == [lower.tolist(), (lower + values.shape).tolist()]


@given(places, st.tuples(*[st.integers(1, 200)] * 3))
def test_parts_cover_a_box_once(lower, shape):
    covered = np.zeros(shape, int)
    for key, in_box, in_block in block_parts(lower, shape):
        covered[in_box] += 1
        for axis in range(3):
            first = lower[axis] + in_box[axis].start
            assert first // SIDE == key[axis] and first % SIDE == in_block[axis].start
    assert (covered == 1).all()


@given(hnp.arrays(np.int64, st.tuples(st.integers(0, 20), st.just(3)), elements=st.integers(-200, 200)))
def test_single_values_are_those_of_the_box_around_them(index):
    array = BlockArray(2**30)
    array.write(np.array([-70, 3, 0]), np.arange(90 * 60 * 50, dtype=np.int8).reshape(90, 60, 50))
    expected = [array.read(place, (1, 1, 1)).item() for place in index]
    assert array.at(index).tolist() == expected


def test_growing_leaves_the_blocks_where_they_are():
    array = BlockArray(2**30)
    array.reserve([(0, 0, 0)])
    block = array[0, 0, 0]
    array.reserve([(n, -n, 0) for n in range(50)])
    assert array[0, 0, 0] is block
    assert array.nbytes == 50 * SIDE**3


def test_a_full_array_takes_nothing_of_what_is_too_much():
    array = BlockArray(2 * SIDE**3)
    array.reserve([(0, 0, 0)])
    with pytest.raises(InputError, match="bytes"):
        array.reserve([(0, 0, 0), (1, 0, 0), (2, 0, 0)])
    assert array.nbytes == SIDE**3


def test_an_empty_array_has_no_extent():
    assert [corner.tolist() for corner in BlockArray(2**30).bounds()] == [[0, 0, 0], [0, 0, 0]]
