"""Fast sweeping: every active node is updated, and subdomains that exchange faces give the same times."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from bentray_kernels import eikonal
from bentray_kernels.eikonal import fast_sweeping
from bentray_kernels.eikonal.diagonals import Diagonals
from bentray_kernels.eikonal.problem import PointSource
from bentray_kernels.eikonal.subdomains import Block, sides
from bentray_kernels.errors import InvalidInput

from ...effort import effort
from .blocks import solve_by_blocks


def plain_sweeps(speed, spacing, source):
    """The textbook: full Gauss–Seidel sweeps in all orders, until nothing changes."""
    problem = PointSource.checked(speed, spacing, source)
    seeds, times = problem.seeds()
    time = np.full(problem.padded_slowness.size, np.inf)
    time[seeds] = times
    time = time.reshape(problem.padded_shape)
    changed = True
    while changed:
        changed = False
        for flip in np.ndindex(*(2,) * speed.ndim):
            for node in np.ndindex(*speed.shape):
                at = tuple(n - i if f else i + 1 for i, n, f in zip(node, speed.shape, flip, strict=True))
                lowest = []
                for axis in range(speed.ndim):
                    step = np.eye(speed.ndim, dtype=int)[axis]
                    lowest.append(min(time[tuple(at - step)], time[tuple(at + step)]))
                if min(lowest) == np.inf:
                    continue
                rhs = spacing / speed[tuple(i - 1 for i in at)]
                new = np.inf
                for used in range(1, speed.ndim + 1):
                    best = np.array(sorted(lowest)[:used]) - min(lowest)
                    if best[-1] < new - min(lowest):
                        root = best.sum() ** 2 - used * ((best**2).sum() - rhs**2)
                        new = min(lowest) + (best.sum() + np.sqrt(root)) / used
                if new < time[at] * (1.0 - 1e-13):
                    time[at] = new
                    changed = True
    return time[(slice(1, -1),) * speed.ndim]


SHAPES = st.sampled_from([(9, 9), (17, 3), (1, 12), (10, 26), (4, 5, 6), (1, 3, 9), (5, 1, 1), (3, 3, 17)])


@given(shape=SHAPES, seed=st.integers(0, 2**32 - 1))
@settings(max_examples=effort(20, 30), deadline=None)
def test_skipping_settled_nodes_keeps_the_result(shape, seed):
    rng = np.random.default_rng(seed)
    speed = rng.uniform(0.1, 5.0, shape)
    source = rng.uniform(0.0, 1.0, len(shape)) * (np.array(shape) - 1)
    assert np.allclose(
        eikonal.solve(speed, 1.0, source, "fsm"), plain_sweeps(speed, 1.0, source), rtol=1e-11, atol=0.0
    )


@pytest.mark.parametrize("shape", [(300, 31), (70, 140), (9, 40, 33)])
def test_grids_longer_than_a_patch_equal_marching(shape):
    speed = np.random.default_rng(8).uniform(0.2, 5.0, shape)
    source = 0.37 * (np.array(shape) - 1)
    marched = eikonal.solve(speed, 1.0, source, "fmm", order=1)
    assert np.allclose(eikonal.solve(speed, 1.0, source, "fsm"), marched, rtol=1e-11, atol=0.0)


def test_a_tolerance_ends_early_and_stays_close():
    speed = np.random.default_rng(2).uniform(0.2, 5.0, (60, 60))
    exact = eikonal.solve(speed, 1.0, (30.0, 30.0), "fsm")
    close = eikonal.solve(speed, 1.0, (30.0, 30.0), "fsm", tolerance=0.5)
    assert not np.array_equal(close, exact)
    assert (close >= exact).all()
    assert np.allclose(close, exact, rtol=0.1)
    assert np.allclose(eikonal.solve(speed, 1.0, (30.0, 30.0), "fsm", tolerance=0.0), exact, rtol=1e-12)


def test_arrays_used_again_change_nothing():
    rng = np.random.default_rng(3)
    sweeper = fast_sweeping.Sweeper((20, 30))
    speeds = [rng.uniform(0.2, 5.0, (20, 30)) for _ in range(2)]
    for which, spacing, source in ((0, 1.0, 2.0), (0, 1.0, 9.0), (0, 2.0, 9.0), (1, 2.0, 9.0), (0, 1.0, 2.0)):
        problem = PointSource.checked(speeds[which], spacing, (source, source))
        again = np.empty((20, 30))
        sweeper.solve(problem, 1e-12, again)
        assert np.array_equal(again, eikonal.METHODS["fsm"].run(problem))


def test_the_square_root_is_taken_of_vectors():
    """Without it a sweep takes four times as long, and nothing else would tell."""
    # Compiled once more, for cached code cannot be read.
    fresh = njit(nogil=True, error_model="numpy")(fast_sweeping._sweep_3d.py_func)
    grid = Diagonals.from_shape((4, 4, 4))
    time, crossing = np.full((2, grid.size), np.inf)
    active_in_plane, across, changed = (grid.empty_ranges() for _ in range(3))
    fresh(fast_sweeping.Grid(time, crossing, active_in_plane, across, changed, grid.shape, grid.stored), 0.0)
    (assembly,) = fresh.inspect_asm().values()
    if "vsqrt" not in assembly:
        pytest.skip("not a processor with AVX")
    # Once in the branch for two axes, twice in that for three.
    assert assembly.count("vsqrtpd") >= 3


@pytest.mark.parametrize("shape", [(40, 33, 29), (3, 70, 20), (1, 9, 40), (21, 2, 5)])
def test_threads_share_a_sweep_and_give_the_same_bits(shape):
    speed = np.random.default_rng(5).uniform(0.2, 5.0, shape)
    source = 0.3 * (np.array(shape) - 1)
    alone = eikonal.solve(speed, 1.0, source, "fsm")
    for method in ("fsm", "fsm-simultaneous"):
        shared = eikonal.solve(speed, 1.0, source, method, threads=2)
        assert np.allclose(shared, alone, rtol=1e-12, atol=0.0)
        for threads in (2, 3, 7):
            assert np.array_equal(eikonal.solve(speed, 1.0, source, method, threads=threads), shared)


def test_a_plane_is_swept_by_one_thread():
    speed = np.random.default_rng(6).uniform(0.2, 5.0, (40, 30))
    alone = eikonal.solve(speed, 1.0, (3.0, 4.0), "fsm")
    assert np.array_equal(eikonal.solve(speed, 1.0, (3.0, 4.0), "fsm", threads=4), alone)


@pytest.mark.parametrize("method", ["fsm", "fsm-simultaneous"])
@pytest.mark.parametrize("threads", [0, 65, 1.5, True, "2"])
def test_numbers_of_threads_are_whole_and_few(method, threads):
    with pytest.raises(InvalidInput, match=r"threads.*from 1 to 64"):
        eikonal.solve(np.ones((4, 4, 4)), 1.0, (0.0, 0.0, 0.0), method, threads=threads)


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
