"""Linearised travel times: exact data have zero residual, and the rows equal finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels import eikonal, rays
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.gauss_newton.linearisation import linearise
from bentray_kernels.tomography.problem import Problem

NODES, SPACING, WATER = 48, 2e-3, 1500.0


def medium(bump_mps=60.0):
    """Slowness of a smooth bump in water."""
    x = (np.arange(NODES) - 0.5 * (NODES - 1)) * SPACING
    return 1.0 / (WATER + bump_mps * np.exp(-(x[:, None] ** 2 + (x[None, :] - 6e-3) ** 2) / (2 * 0.012**2)))


@pytest.fixture
def problem():
    """A ring of 12 elements around ``medium``, its times along bent rays."""
    ring = 0.5 * (NODES - 1) * SPACING + Ring(12, 0.04).positions()
    slowness = medium()
    delta = np.full((12, 12), np.nan)
    for k, source in enumerate(ring):
        others = np.arange(12) != k
        tof = eikonal.solve(1.0 / slowness, SPACING, source)
        times = rays.travel_times(tof, 1.0 / slowness, SPACING, ring[others], source)
        delta[k, others] = times - np.linalg.norm(ring[others] - source, axis=1) / WATER
    region = np.ones((NODES, NODES), dtype=bool)
    return Problem(
        ring,
        ring[None],
        np.zeros(12, int),
        delta,
        region=region,
        spacing=SPACING,
        origin=(0.0, 0.0),
        water_speed=WATER,
    )


def dense(rows):
    matrix = np.zeros((len(rows.residual), NODES * NODES))
    for k in range(len(rows.residual)):
        entries = slice(rows.pointers[k], rows.pointers[k + 1])
        matrix[k, rows.columns[entries]] = rows.lengths[entries]
    return matrix


def test_exact_data_have_zero_residual(problem):
    rows = linearise(problem, Settings(method="sart"), medium(), np.arange(12))
    assert np.abs(rows.residual).max() < 1e-11
    assert len(rows.counts) == 12


def test_one_by_one_is_all_at_once(problem):
    whole = linearise(problem, Settings(method="sart"), medium(), np.arange(12))
    single = [linearise(problem, Settings(method="sart"), medium(), np.array([k])) for k in range(12)]
    assert np.array_equal(np.concatenate([part.residual for part in single]), whole.residual)
    assert np.array_equal(np.concatenate([part.columns for part in single]), whole.columns)
    assert np.array_equal(np.concatenate([part.lengths for part in single]), whole.lengths)


def test_rows_are_the_derivative_of_the_times(problem):
    """Fermat: the times change by Σ length·δslowness, the path's own change being of second order."""
    x = np.linspace(-1.0, 1.0, NODES)
    change = 1e-3 / WATER * np.exp(-((x[:, None] - 0.2) ** 2 + (x[None, :] + 0.1) ** 2) / 0.2)
    here = linearise(problem, Settings(method="sart"), medium(), np.arange(12))
    there = linearise(problem, Settings(method="sart"), medium() + change, np.arange(12))
    predicted = dense(here) @ change.ravel() * SPACING
    moved = here.residual - there.residual
    assert np.abs(moved - predicted).max() < 5e-3 * np.abs(predicted).max()


@pytest.mark.parametrize("kind", ["curved", "straight"])
def test_rows_sum_to_the_length_of_the_ray(problem, kind):
    rows = linearise(problem, Settings(method="sart", rays=kind), medium(), np.array([3]))
    lengths = np.add.reduceat(rows.lengths, rows.pointers[:-1]) * SPACING
    straight = np.linalg.norm(np.delete(problem.receivers[0], 3, axis=0) - problem.emitters[3], axis=1)
    assert (lengths >= straight * (1.0 - 1e-5)).all()
    assert (lengths <= straight * (1.02 if kind == "curved" else 1.0 + 1e-5)).all()


def test_pairs_without_data_have_no_row(problem):
    gaps = problem.delta_tof.copy()
    gaps[3, 5:] = np.nan
    settings = Settings(method="sart", rays="straight")
    rows = linearise(replace(problem, delta_tof=gaps), settings, medium(), np.array([3]))
    assert len(rows.residual) == 4


def test_rays_of_a_ring_in_a_volume_stay_at_its_height():
    """Straight rays between elements of one height, as far below the top of the volume as above its floor."""
    nodes, heights = 16, 13
    ring = np.column_stack((7.5 * SPACING + Ring(6, 0.012).positions(), np.full(6, 7 * SPACING)))
    delta = np.where(np.eye(6, dtype=bool), np.nan, 0.0)
    region = np.ones((nodes, nodes, heights), dtype=bool)
    volume = Problem(
        ring,
        ring[None],
        np.zeros(6, int),
        delta,
        region=region,
        spacing=SPACING,
        origin=(0.0,) * 3,
        water_speed=WATER,
    )
    rows = linearise(
        volume, Settings(method="sart", rays="straight"), np.full(region.shape, 1 / WATER), np.arange(6)
    )
    x, y, z = np.unravel_index(rows.columns, region.shape)
    assert rows.columns.size > 100
    assert set(z[rows.lengths > 1e-3]) == {7}
    # The first ray passes the middle between its ends.
    assert np.hypot(x - 7.5, y - 7.5).max() < 0.012 / SPACING + 2.0
    np.testing.assert_allclose(rows.residual, 0.0, atol=1e-11)
