"""Traces read an emission at a time give, after any exchanges and turns, what arrays of them give."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from bentray_kernels.acquisition.emissions import Emissions, invert_polarity, reorder_channels

SHAPE = (4, 5, 3)

steps = st.one_of(
    st.tuples(st.just(0), st.permutations(range(SHAPE[0]))),
    st.tuples(st.just(1), st.permutations(range(SHAPE[1]))),
    st.tuples(st.just(2), arrays(bool, SHAPE[:2])),
)


@given(
    traces=st.one_of(
        # The lowest integer has no opposite: an array inverted twice has lost it, emissions have not.
        arrays(np.int16, SHAPE, elements=st.integers(-(2**15) + 1, 2**15 - 1)),
        arrays(np.float32, SHAPE, elements=st.floats(width=32, allow_nan=True)),
    ),
    done=st.lists(steps, max_size=5),
)
def test_they_read_as_the_array_that_went_through_the_same(traces, done):
    asked = []

    def read(e):
        asked.append(e)
        return traces[e]

    whole, lazily = traces, Emissions.from_reader(read, traces.shape, traces.dtype)
    for axis, how in done:
        if axis == 2:
            whole, lazily = invert_polarity(whole, how), invert_polarity(lazily, how)
        else:
            order = np.array(how)
            whole, lazily = reorder_channels(whole, order, axis), reorder_channels(lazily, order, axis)
    assert asked == []
    assert (lazily.shape, lazily.ndim, lazily.dtype, len(lazily)) == (SHAPE, 3, traces.dtype, SHAPE[0])
    np.testing.assert_array_equal(np.asarray(lazily), whole)
    np.testing.assert_array_equal(lazily[2], whole[2])
    for own, theirs in zip(lazily, whole, strict=True):
        np.testing.assert_array_equal(own, theirs)


def test_the_lowest_whole_number_turns_into_the_highest():
    lowest = np.full((1, 1, 2), -(2**15), np.int16)
    np.testing.assert_array_equal(
        invert_polarity(lowest, np.ones((1, 1), bool)), np.full((1, 1, 2), 2**15 - 1)
    )
