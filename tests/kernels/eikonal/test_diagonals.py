"""Grids stored by diagonals: lossless conversion, flips and scaling."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.eikonal.diagonals import FIRST, Diagonals, include

SHAPES = st.one_of(
    st.tuples(st.integers(1, 40), st.integers(1, 90)),
    st.tuples(st.integers(1, 4), st.integers(1, 20), st.integers(1, 70)),
)


def numbered(shape):
    """A padded grid whose values are its flat indices."""
    return np.arange(np.prod([n + 2 for n in shape]), dtype=float)


@given(shape=SHAPES, flipped=st.booleans())
def test_a_grid_comes_back_whole(shape, flipped):
    grid = Diagonals.from_shape(shape)
    plain = numbered(shape)
    stored = np.full(grid.size, -1.0)
    grid.copy(plain, stored, flipped)
    back = np.full(plain.size, -1.0)
    grid.copy(back, stored, flipped, back=True)
    assert np.array_equal(back, plain)
    assert np.count_nonzero(stored >= 0.0) == plain.size
    turned = np.full(grid.size, -1.0)
    grid.mirror(stored, turned)
    other = np.full(grid.size, -1.0)
    grid.copy(plain, other, not flipped)
    assert np.array_equal(turned, other)


def test_neighbours_lie_in_the_rows_before_and_after():
    shape = (5, 6)
    grid = Diagonals.from_shape(shape)
    stored = np.full(grid.size, np.nan)
    grid.copy(numbered(shape), stored, False)
    rows = stored.reshape(grid.stored)
    j, k = 3, 4
    column = k - 1 + FIRST
    assert rows[j + k, column] == j * 8 + k
    assert rows[j + k - 1, [column - 1, column]].tolist() == [j * 8 + k - 1, (j - 1) * 8 + k]
    assert rows[j + k + 1, [column, column + 1]].tolist() == [(j + 1) * 8 + k, j * 8 + k + 1]


@given(shape=SHAPES, flipped=st.booleans())
def test_the_border_can_be_left_out_and_values_scaled(shape, flipped):
    grid = Diagonals.from_shape(shape)
    inside = np.arange(np.prod(shape), dtype=float)
    stored = np.full(grid.size, np.inf)
    grid.copy(inside, stored, flipped, scale=3.0, border=False)
    assert np.count_nonzero(np.isfinite(stored)) == inside.size
    whole = np.full(numbered(shape).size, -1.0)
    grid.copy(whole, stored, flipped, back=True)
    assert np.array_equal(
        whole.reshape([n + 2 for n in shape])[(slice(1, -1),) * len(shape)].ravel(), 3 * inside
    )
    back = np.empty(inside.size)
    grid.copy(back, stored, flipped, border=False, back=True)
    assert np.array_equal(back, 3 * inside)


@given(shape=SHAPES, seed=st.integers(0, 99))
def test_nodes_are_put_where_storing_puts_them(shape, seed):
    grid = Diagonals.from_shape(shape)
    plain = numbered(shape)
    nodes = np.random.default_rng(seed).integers(0, plain.size, 7)
    stored, put = np.full((2, grid.size), -1.0)
    only = np.full(plain.size, -1.0)
    only[nodes] = plain[nodes]
    grid.copy(only, stored, False)
    grid.put(nodes, plain[nodes], put)
    assert np.array_equal(put, stored)


@given(shape=SHAPES, seed=st.integers(0, 99), many=st.booleans())
def test_turning_what_changed_turns_the_whole(shape, seed, many):
    grid = Diagonals.from_shape(shape)
    rng = np.random.default_rng(seed)
    stored, turned, expected = np.full((3, grid.size), -1.0)
    grid.copy(numbered(shape), stored, False)
    grid.mirror(stored, turned)
    inside = np.flatnonzero(np.pad(np.ones(shape), 1).ravel())
    nodes = rng.choice(inside, inside.size if many else 1, replace=False)
    grid.put(nodes, rng.uniform(0.0, 1.0, nodes.size), stored)
    changed = grid.empty_ranges()
    _, nj, nk = grid.shape
    for node in nodes:
        row, k = divmod(int(node), nk + 2)
        plane, j = divmod(row, nj + 2)
        include(*changed, plane + 1 if grid.shape[0] else 0, j + k, k, k, grid.shape)
    grid.mirror(stored, turned, changed=changed)
    grid.mirror(stored, expected)
    assert np.array_equal(turned, expected)


def members(grid, low, high):
    """Flat padded indices of the nodes between the columns."""
    _, nj, nk = grid.shape
    return {
        ((plane - 1 if grid.shape[0] else 0) * (nj + 2) + s - k) * (nk + 2) + k
        for plane, s in zip(*np.nonzero(low <= high), strict=True)
        for k in range(low[plane, s], high[plane, s] + 1)
    }


@pytest.mark.parametrize("shape", [(4, 5), (1, 3), (3, 4, 5)])
def test_neighbours_of_a_node_are_those_of_the_grid(shape):
    grid = Diagonals.from_shape(shape)
    padded = tuple(n + 2 for n in shape)
    computed = grid.empty_ranges()
    for node in np.ndindex(padded):
        expected = set()
        for axis in range(len(shape)):
            for step in (-1, 1):
                near = list(node)
                near[axis] += step
                if all(1 <= i <= n for i, n in zip(near, shape, strict=True)):
                    expected.add(int(np.ravel_multi_index(near, padded)))
        computed.clear()
        grid.include_neighbours(np.array([np.ravel_multi_index(node, padded)]), computed)
        assert members(grid, *computed) == expected


@given(shape=SHAPES, seed=st.integers(0, 99))
def test_flipping_keeps_every_node(shape, seed):
    grid = Diagonals.from_shape(shape)
    rng = np.random.default_rng(seed)
    nodes = rng.integers(0, numbered(shape).size, 5)
    near, flipped = grid.empty_ranges(), grid.empty_ranges()
    grid.include_neighbours(nodes, near)
    grid.mirror_mask(near, flipped)
    _, nj, nk = grid.shape
    turned = members(grid, *flipped)
    for node in members(grid, *near):
        row, k = divmod(node, nk + 2)
        plane, j = divmod(row, nj + 2)
        assert (plane * (nj + 2) + nj + 1 - j) * (nk + 2) + k in turned
