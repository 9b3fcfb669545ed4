"""Subdomains that exchange faces give the same times as the whole grid."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal
from bentray_kernels.eikonal.problem import PointSource
from bentray_kernels.eikonal.subdomains import sweep_block
from bentray_kernels.errors import InvalidInput

from .blocks import solve_by_blocks

GRIDS = st.sampled_from([((20, 17), (3, 2)), ((5, 6), (5, 3)), ((30, 4), (1, 4)), ((8, 9, 7), (2, 3, 2))])


@given(grid=GRIDS, seed=st.integers(0, 2**32 - 1), on_node=st.booleans())
@settings(max_examples=15, deadline=None)
def test_blocks_equal_the_whole(grid, seed, on_node):
    shape, blocks = grid
    rng = np.random.default_rng(seed)
    speed = rng.uniform(0.2, 5.0, shape)
    source = rng.uniform(0.0, 1.0, len(shape)) * (np.array(shape) - 1)
    source = np.round(source) if on_node else source
    problem = PointSource.checked(speed, 1.0, source)
    whole = eikonal.solve(speed, 1.0, source, "fsm")
    assert np.allclose(solve_by_blocks(problem, blocks), whole, rtol=1e-11, atol=0.0)


def test_one_block_is_the_whole_bit_for_bit():
    speed = np.random.default_rng(3).uniform(0.2, 5.0, (12, 13))
    problem = PointSource.checked(speed, 1.0, (3.3, 4.4))
    assert np.array_equal(solve_by_blocks(problem, (1, 1)), eikonal.solve(speed, 1.0, (3.3, 4.4), "fsm"))


def test_a_front_enters_through_a_face_and_leaves_through_the_others():
    slowness = np.ones((4, 3))
    swept = sweep_block(slowness, np.full((4, 3), np.inf), (np.full(3, 7.0), None, None, None), 2.0)
    assert np.allclose(swept.times, 7.0 + 2.0 * np.arange(1, 5)[:, None])
    assert [f.tolist() for f in swept.faces[:2]] == [[9.0] * 3, [15.0] * 3]
    assert swept.faces[2].tolist() == swept.faces[3].tolist() == [9.0, 11.0, 13.0, 15.0]
    assert swept.changed == (True,) * 4


def test_settled_block_is_not_updated():
    slowness = np.random.default_rng(0).uniform(1.0, 2.0, (5, 6, 4))
    faces = (np.zeros((6, 4)), None, None, np.ones((5, 4)), None, None)
    times = np.full((5, 6, 4), np.inf)
    first = sweep_block(slowness, times, faces, 1.0)
    assert np.isinf(times).all()
    again = sweep_block(slowness, first.times, faces, 1.0)
    assert again.changed == (False,) * 6
    assert np.array_equal(again.times, first.times)


def test_shapes_that_do_not_match_are_named():
    with pytest.raises(InvalidInput, match="times"):
        sweep_block(np.ones((3, 3)), np.ones((3, 4)), (None,) * 4, 1.0)
    with pytest.raises(InvalidInput, match=r"faces\[2\]"):
        sweep_block(np.ones((3, 4)), np.ones((3, 4)), (None, None, np.ones(4), None), 1.0)
    problem = PointSource.checked(np.ones((4, 4)), 1.0, (1.0, 1.0))
    for blocks in ((2,), (0, 2), (5, 1)):
        with pytest.raises(InvalidInput, match="blocks"):
            solve_by_blocks(problem, blocks)
