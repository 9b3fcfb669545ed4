"""Subdomains on a cluster give the times of the whole grid, and reject invalid input."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bentray_kernels import eikonal
from bentray_kernels.eikonal.problem import PointSource
from bentray_kernels.errors import InvalidInput
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.reconstruction import subdomains

from ...effort import effort
from ...kernels.eikonal.blocks import solve_by_blocks

GRIDS = st.sampled_from([((20, 17), (3, 2)), ((5, 6), (5, 3)), ((30, 4), (1, 4)), ((8, 9, 7), (2, 3, 2))])


@given(grid=GRIDS, seed=st.integers(0, 2**32 - 1), on_node=st.booleans())
@settings(
    max_examples=effort(4, 20),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_blocks_equal_the_whole_domain(cluster, grid, seed, on_node):
    shape, blocks = grid
    rng = np.random.default_rng(seed)
    speed, spacing = rng.uniform(300.0, 5000.0, shape), 1.5e-3
    source = rng.uniform(0.0, 1.0, len(shape)) * (np.array(shape) - 1)
    source = spacing * (np.round(source) if on_node else source)
    field = subdomains.solve(cluster.client, speed, spacing, source, blocks)
    assert np.allclose(field, eikonal.solve(speed, spacing, source, "fsm"), rtol=1e-12, atol=0.0)
    same = solve_by_blocks(PointSource.checked(speed, spacing, source), blocks)
    assert np.array_equal(field, same)


def test_a_file_serves_and_blocks_can_be_had_one_by_one(cluster, tmp_path):
    speed = np.random.default_rng(1).uniform(1.0, 2.0, (12, 10, 9))
    np.save(tmp_path / "speed.npy", speed.astype(np.float32))
    path, source = tmp_path / "speed.npy", (5.5, 5.0, 2.2)
    field = subdomains.solve_in_blocks(cluster.client, path, 1.0, source, (2, 2, 1))
    expected = eikonal.solve(speed.astype(np.float32), 1.0, (5.5, 5.0, 2.2), "fsm")
    assert np.allclose(field.whole(), expected, rtol=1e-12, atol=0.0)
    assert np.array_equal(field.block((1, 0, 0)), field.whole()[6:, :5])
    assert field.rounds > 1


def test_source_at_a_block_corner_activates_all_blocks(cluster):
    """Seeds that no sweep can improve must still reach the neighbours."""
    speed = np.ones((4, 4))
    field = subdomains.solve(cluster.client, speed, 1.0, (1.5, 1.5), (2, 2))
    assert np.isfinite(field).all()
    assert np.allclose(field, field.T)
    assert field[1, 1] == pytest.approx(0.5**0.5)


def test_blocks_of_a_lost_worker_are_recomputed(tmp_path):
    """A later request for a block goes back as far as it must, to the same bits."""
    speed = np.random.default_rng(2).uniform(1.0, 2.0, (9, 8))
    expected = solve_by_blocks(PointSource.checked(speed, 1.0, (2.0, 2.0)), (2, 2))
    with open_cluster(workers=2, local_directory=tmp_path, processes=False) as cluster:
        client = cluster.client
        field = subdomains.solve_in_blocks(client, speed, 1.0, (2.0, 2.0), (2, 2))
        worker = next(iter(client.cluster.workers.values()))
        client.sync(worker.close, nanny=False, executor_wait=False)
        assert np.array_equal(field.whole(), expected)


@pytest.mark.parametrize("at_once", [1, 3, None])
def test_fields_of_several_sources_come_in_their_order(cluster, at_once):
    speed = np.random.default_rng(4).uniform(1.0, 2.0, (9, 8, 7))
    sources = [(1.0, 2.0, 3.0), (8.0, 7.0, 0.0), (4.2, 0.1, 5.0), (0.0, 0.0, 6.0), (3.0, 3.3, 3.6)]
    fields = subdomains.solve_many_in_blocks(cluster.client, speed, 1.0, sources, (2, 1, 2), at_once=at_once)
    for source, field in zip(sources, fields, strict=True):
        alone = subdomains.solve(cluster.client, speed, 1.0, source, (2, 1, 2))
        assert np.array_equal(field.whole(), alone)


def test_fields_at_once_are_at_least_one(cluster):
    with pytest.raises(InvalidInput, match=r"at_once.*>= 1"):
        next(
            subdomains.solve_many_in_blocks(cluster.client, np.ones((4, 4)), 1.0, [(1, 1)], (2, 2), at_once=0)
        )


def test_a_task_that_runs_again_tells_the_neighbours_again():
    """Dask may run a task again whose block has been swept already."""
    before = subdomains.begin(np.ones((4, 4)), 1.0, {(0, 0): 0.0})
    first = subdomains.sweep(before, [None] * 4, 1e-12)
    again = subdomains.sweep(before, [None] * 4, 1e-12)
    assert first.halo.changed == again.halo.changed == (True,) * 4
    assert all(np.array_equal(a, b) for a, b in zip(first.halo.faces, again.halo.faces, strict=True))


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"speed": np.ones(5)}, "speed"),
        ({"speed": np.where(np.arange(36).reshape(6, 6) == 35, -1.0, 1.0)}, r"-1 at node \(5, 5\)"),
        ({"speed": np.where(np.arange(36).reshape(6, 6) == 14, np.nan, 1.0)}, r"nan at node \(2, 2\)"),
        ({"spacing": 0.0}, "spacing"),
        ({"source": (9.0, 1.0)}, "source"),
        ({"blocks": (2, 7)}, "blocks"),
    ],
)
def test_names_incompatible_input(cluster, changes, field):
    asked = {"speed": np.ones((6, 6)), "spacing": 1.0, "source": (2.0, 2.0), "blocks": (2, 2), **changes}
    with pytest.raises(InvalidInput, match=field):
        subdomains.solve(cluster.client, **asked)


def test_a_file_that_is_none_is_named(cluster, tmp_path):
    (tmp_path / "speed.npy").write_bytes(b"no array")
    for name in ("speed.npy", "nothing.npy"):
        with pytest.raises(InvalidInput, match=name):
            subdomains.solve(cluster.client, tmp_path / name, 1.0, (2.0, 2.0), (2, 2))
