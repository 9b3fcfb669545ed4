"""Subdomains that exchange faces give the same times as the whole grid."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal
from bentray_kernels.eikonal.problem import PointSource
from bentray_kernels.eikonal.subdomains import Block, sides
from bentray_kernels.errors import InvalidInput

from ...effort import effort
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
    block = Block(np.ones((4, 3)), 2.0, {})
    edges = block.sweep((np.full(3, 7.0), None, None, None), None)
    assert np.allclose(block.times(), 7.0 + 2.0 * np.arange(1, 5)[:, None])
    assert [f.tolist() for f in edges.faces[:2]] == [[9.0] * 3, [15.0] * 3]
    assert edges.faces[2].tolist() == edges.faces[3].tolist() == [9.0, 11.0, 13.0, 15.0]
    assert edges.changed == (True,) * 4


def test_a_repeated_sweep_changes_nothing():
    slowness = np.random.default_rng(0).uniform(1.0, 2.0, (5, 6, 4))
    faces = (np.zeros((6, 4)), None, None, np.ones((5, 4)), None, None)
    block = Block(slowness, 1.0, {(2, 2, 2): 0.1})
    first, times = block.sweep(faces, None), block.times()
    again = block.sweep(faces, None)
    assert again.changed == first.changed == (True,) * 6
    assert all(np.array_equal(a, b) for a, b in zip(again.faces, first.faces, strict=True))
    assert block.sweep(faces, first).changed == (False,) * 6
    assert np.array_equal(block.times(), times)


@given(seed=st.integers(0, 2**32 - 1), shape=st.sampled_from([(7, 9), (5, 4, 6)]))
@settings(max_examples=effort(10, 200), deadline=None)
def test_earlier_faces_lower_the_times_as_if_all_had_arrived_at_once(seed, shape):
    rng = np.random.default_rng(seed)
    slowness = rng.uniform(0.2, 5.0, shape)
    given = [rng.uniform(0.0, 9.0, shape[:axis] + shape[axis + 1 :]) for axis, _ in sides(len(shape))]
    at_once, one_by_one = Block(slowness, 1.0, {}), Block(slowness, 1.0, {})
    at_once.sweep(given, None)
    for number, face in enumerate(given):
        # A later face comes first, and part of it never.
        arrived = np.where(rng.uniform(size=face.shape) < 0.7, face, np.inf)
        for arriving in (arrived + 1.0, arrived, face):
            one_by_one.sweep([arriving if n == number else None for n in range(len(given))], None)
    assert np.allclose(one_by_one.times(), at_once.times(), rtol=1e-11, atol=0.0)


def test_shapes_that_do_not_match_are_named():
    with pytest.raises(InvalidInput, match=r"faces\[2\]"):
        Block(np.ones((3, 4)), 1.0, {}).sweep((None, None, np.ones(4), None), None)
    problem = PointSource.checked(np.ones((4, 4)), 1.0, (1.0, 1.0))
    for blocks in ((2,), (0, 2), (5, 1)):
        with pytest.raises(InvalidInput, match="blocks"):
            solve_by_blocks(problem, blocks)
