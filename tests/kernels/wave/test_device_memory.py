"""Device memory of emitters in flight: checkpoints where needed, and no more arrays than a limit holds."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.wave.device_memory import ShotPlan, ShotSize

SIZES = st.builds(
    ShotSize,
    st.integers(1, 10**6),
    st.integers(1, 10**6),
    st.integers(0, 300),
    st.integers(0, 10**6),
    st.sampled_from([4, 8]),
)


@given(SIZES, st.integers(1, 10**9), st.integers(1, 10**9))
def test_a_plan_fits_or_there_is_none(size, limit, array):
    fitting = [
        segments
        for segments in range(1, max(1, size.slots) + 1)
        if size.bytes(segments) <= limit and size.largest_bytes(segments) <= array
    ]
    if not fitting:
        with pytest.raises(InvalidInput, match=f"at most {limit} bytes, {array} in one array"):
            ShotPlan.for_memory(size, limit, array)
        return
    plan = ShotPlan.for_memory(size, limit, array)
    assert plan.segments == fitting[0]
    assert plan.emitters >= 1
    assert plan.emitters * size.bytes(plan.segments) <= limit
    assert plan.emitters * size.largest_bytes(plan.segments) <= array


def test_a_volume_takes_checkpoints_of_a_few_dozen_fields():
    # 256 nodes a side with edges, 1000 steps, every fourth field: 250 stored ones would take 17 GB.
    size = ShotSize(304**3, 256**3, 250, 1000 * 256, 4)
    assert size.bytes(1) > 17e9
    plan = ShotPlan.for_memory(size, 6e9, math.inf)
    assert plan.emitters == 1
    assert 3 < plan.segments < 8
    assert size.bytes(plan.segments) < 6e9
