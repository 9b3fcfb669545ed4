"""The octree: each node covers exactly the iso-values of its cells."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.isosurface import CellRanges
from bentray_kernels.isosurface.octree import octree_of

ISOS = (0.2, 0.5)


def ranges_of(shape: tuple[int, int, int], seed: int) -> CellRanges:
    ends = np.sort(np.random.default_rng(seed).random((2, *shape)) ** 4, axis=0).astype(np.float32)
    return CellRanges(ends[0], ends[1], np.zeros(shape, dtype=np.float32))


@given(shape=st.tuples(*[st.integers(1, 9)] * 3), seed=st.integers(0, 999))
@settings(deadline=None)
def test_a_node_holds_what_its_cells_hold(shape, seed):
    cells = ranges_of(shape, seed)
    octree = octree_of(cells, ISOS)
    for level, (start, *nodes) in enumerate(octree.levels):
        masks = octree.masks[start : start + np.prod(nodes)].reshape(nodes)
        for node in np.ndindex(*nodes):
            part = tuple(slice(k << level, (k + 1) << level) for k in node)
            for bit, iso in enumerate(ISOS):
                held = ((cells.low[part] <= iso) & (cells.high[part] >= iso)).any()
                assert bool(masks[node] >> bit & 1) == held
    assert octree.levels[-1, 1:].tolist() == [1, 1, 1]


def test_the_box_and_the_highest_empty_level():
    low, high = np.ones((8, 8, 8), dtype=np.float32), np.full((8, 8, 8), 2.0, dtype=np.float32)
    low[2, 3, 5] = low[4, 3, 6] = 0.0
    octree = octree_of(CellRanges(low, high, np.zeros_like(low)), (0.5,))
    np.testing.assert_array_equal(octree.occupied(), [[2, 3, 5], [5, 4, 7]])
    assert octree.highest_empty() == 2
    full = octree_of(CellRanges(low * 0.0, high, np.zeros_like(low)), (0.5,))
    assert full.highest_empty() == 0


def test_more_iso_values_than_bits_are_rejected():
    with pytest.raises(InvalidInput, match="iso: found 9 values"):
        octree_of(ranges_of((2, 2, 2), 0), np.arange(9.0))
