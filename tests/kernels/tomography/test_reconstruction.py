"""Requirements on every reconstruction method; a new one inherits the suite by its name in the settings."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.tomography import (
    Iteration,
    Reconstruction,
    Settings,
    mean_absolute_error,
    reconstruct,
    rmse,
)

from ...table6 import table6_scan

METHODS = ("sart", "gauss-newton")
NODES, SIDE, WATER = 64, TABLE6_SIDE_M, 1375.0
TRUTH, INSIDE = table6(WATER).speed(NODES, SIDE), table6(WATER).inside(NODES, SIDE)
RING = Ring(64, 0.09)


@pytest.fixture(scope="module")
def scan():
    return table6_scan(RING.elements, NODES)


@pytest.fixture(params=METHODS)
def method(request):
    return request.param


def plan(method, **changes):
    return Settings.from_values(method=method, nodes=NODES, side_m=SIDE, **changes)


def error(dataset, method):
    """Rms error inside the phantom, m/s."""
    return rmse(reconstruct(dataset, plan(method)).speed, TRUTH, INSIDE)


@pytest.fixture(scope="module")
def whole(scan):
    """Error of each method given every pair, m/s."""
    return {method: error(scan, method) for method in METHODS}


def test_bent_rays_beat_straight_ones(scan, method):
    bent = reconstruct(scan, plan(method))
    straight = reconstruct(scan, plan(method, rays="straight"))
    assert rmse(bent.speed, TRUTH, INSIDE) < 0.7 * rmse(straight.speed, TRUTH, INSIDE)
    assert mean_absolute_error(bent.speed, TRUTH, INSIDE, 185.0) < 0.08
    rms = [sweep.residual_rms_s for sweep in bent.history]
    assert rms[-1] < 0.2 * rms[0]


def test_uniform_medium_is_recovered_exactly(scan, method):
    """A scan of nothing but water stays water; one of another speed inside the ring is found."""
    nothing = replace(scan, delta_tof_s=np.zeros_like(scan.delta_tof_s))
    for kind in ("curved", "straight"):
        result = reconstruct(nothing, plan(method, rays=kind, iterations=1))
        # The compiled pass of SART counts in 32 bits: it errs by about a centimetre a second.
        assert np.allclose(result.speed, WATER, rtol=1e-9 if method == "gauss-newton" else 2e-5)
    warmer = replace(scan, delta_tof_s=scan.distance_m() * (1 / (WATER + 5.0) - 1 / WATER))
    result = reconstruct(warmer, plan(method, rays="straight", iterations=8, relaxation=0.5))
    middle = slice(NODES // 4, 3 * NODES // 4)
    assert np.allclose(result.speed[middle, middle], WATER + 5.0, atol=1.5)


def test_numbering_of_the_elements_does_not_matter(scan, method):
    """Other numbers for the same elements give the same image, up to the random order of emitters."""
    shuffle = np.random.default_rng(3).permutation(RING.elements)
    renamed = replace(
        scan,
        element_position_m=scan.element_position_m[shuffle],
        delta_tof_s=scan.delta_tof_s[np.ix_(shuffle, shuffle)],
    )
    a, b = reconstruct(scan, plan(method)), reconstruct(renamed, plan(method))
    assert rmse(a.speed, b.speed, np.ones_like(a.speed, bool)) < 1.0


def test_half_a_matrix_is_enough_with_reciprocity(scan, method, whole):
    upper = np.where(np.triu(np.ones(scan.delta_tof_s.shape, bool), 1), scan.delta_tof_s, np.nan)
    assert error(replace(scan, delta_tof_s=upper), method) < 1.1 * whole[method]


def test_missing_data_degrade_gracefully(scan, method):
    kept = np.random.default_rng(1).random(scan.delta_tof_s.shape) < 0.1
    nothing = rmse(np.full_like(TRUTH, WATER), TRUTH, INSIDE)
    assert error(replace(scan, valid=kept), method) < 0.6 * nothing


def test_water_outside_the_ring_stays_water(scan, method):
    result = reconstruct(scan, plan(method, iterations=1))
    axis = (np.arange(NODES) / (NODES - 1) - 0.5) * SIDE
    outside = np.hypot(axis[:, None], axis[None, :]) > RING.radius_m
    assert np.allclose(result.speed[outside], WATER)


def test_bounds_hold(scan, method):
    result = reconstruct(scan, plan(method, iterations=2, speed_bounds_mps=(1370.0, 1440.0)))
    assert result.speed.min() >= 1370.0 - 1e-9
    assert result.speed.max() <= 1440.0 + 1e-9


def test_stopping_rule_ends_early(scan, method):
    seen = []
    result = reconstruct(scan, plan(method, iterations=50, stop_rms_s=3e-7, uncertainty=False), seen.append)
    assert len(result.history) < 50
    # What was saved is not counted as done.
    done = [progress.done for progress in seen]
    assert max(np.diff(done)) <= RING.elements
    assert done[-1] == seen[-1].total == len(result.history) * RING.elements
    assert seen[0].total == 50 * RING.elements
    assert result.history[-1].residual_rms_s <= 3e-7
    assert result.history[-2].residual_rms_s > 3e-7


def test_slices_equal_their_single_scans(scan, method):
    stacked = replace(
        scan,
        delta_tof_s=np.stack([scan.delta_tof_s, 0.5 * scan.delta_tof_s]),
        slice_z_m=np.array([0.0, 0.004]),
    )
    volume = reconstruct(stacked, plan(method, iterations=1))
    assert volume.speed.shape == (NODES, NODES, 2)
    assert volume.spacing_m[2] == pytest.approx(0.004)
    assert np.array_equal(volume.speed[..., 0], reconstruct(scan, plan(method, iterations=1)).speed)
    assert [(s.slice, s.sweep) for s in volume.history] == [(0, 1), (1, 1)]


def test_absolute_times_are_the_same_scan(scan, method):
    absolute = replace(scan, delta_tof_s=None, tof_s=scan.delta_tof_s + scan.distance_m() / WATER)
    a, b = reconstruct(scan, plan(method, iterations=1)), reconstruct(absolute, plan(method, iterations=1))
    assert np.allclose(a.speed, b.speed, atol=1e-6)


def test_progress_rises_to_the_end(scan, method):
    seen = []
    reconstruct(scan, plan(method, iterations=2), seen.append)
    done = [p.done for p in seen]
    assert done == sorted(done)
    assert done[-1] == seen[-1].total == 2 * RING.elements


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"side_m": 0.1}, "side_m"),
        ({"eikonal": "magic"}, "eikonal"),
        ({"rays": "wavy"}, "rays"),
        ({"relaxation": 2.0}, "relaxation"),
        ({"relaxation": float("nan")}, "relaxation"),
        ({"nodes": 4}, "nodes"),
        ({"iterations": 0}, "iterations"),
        ({"method": "guess"}, "method"),
        ({"penalty_strength": -1.0}, "gauss_newton.penalty_strength"),
        ({"speed_bounds_mps": (1600.0, 1500.0)}, "speed_bounds_mps"),
        ({"speed_bounds_mps": (1e-300, 1e300)}, "speed_bounds_mps"),
        ({"speed_bounds_mps": (1400.0, 1800.0)}, "speed_bounds_mps"),
        ({"speed_range_mps": (1400.0, float("inf"))}, "speed_range_mps"),
        ({"side_m": 20.0}, "geometry/element_position_m"),
        ({"seed": -1}, "seed"),
        ({"picker": "eye"}, "picking.picker"),
    ],
)
def test_bad_settings_are_named(scan, change, field):
    with pytest.raises(InvalidInput, match=f"^{field}: found"):
        reconstruct(scan, Settings.from_values(**{"method": "sart", "nodes": NODES, **change}))


def test_scan_without_one_valid_pair_is_rejected(scan, method):
    with pytest.raises(InvalidInput, match="at least one finite travel time"):
        reconstruct(replace(scan, valid=np.zeros(scan.delta_tof_s.shape, bool)), plan(method))


def test_the_slice_without_a_valid_pair_is_named(scan, method):
    times = np.stack([scan.delta_tof_s, np.full_like(scan.delta_tof_s, np.nan)])
    stacked = replace(scan, delta_tof_s=times, slice_z_m=np.array([0.0, 0.004]))
    with pytest.raises(InvalidInput, match="slice 1"):
        reconstruct(stacked, plan(method))


@pytest.mark.parametrize(
    "position",
    [
        np.zeros((RING.elements, 2)),
        np.column_stack((np.linspace(-0.05, 0.05, RING.elements), np.zeros(RING.elements))),
    ],
    ids=["one point", "a line"],
)
def test_an_array_that_surrounds_no_image_is_rejected(scan, position):
    with pytest.raises(InvalidInput, match=r"^geometry/element_position_m: found"):
        reconstruct(replace(scan, element_position_m=position), Settings(method="sart", nodes=32))


def test_repeated_run_gives_the_same_bits(scan, method):
    a, b = (reconstruct(scan, plan(method, iterations=2)) for _ in range(2))
    assert np.array_equal(a.speed, b.speed)
    assert np.array_equal(a.coverage, b.coverage)
    assert a.history == b.history


def test_a_dead_element_leaves_the_rest(scan, method, whole):
    deaf = scan.delta_tof_s.copy()
    deaf[7, :] = deaf[:, 7] = np.nan
    assert error(replace(scan, delta_tof_s=deaf), method) < 1.15 * whole[method]


def test_coincident_elements_are_accepted(scan, method, whole):
    position, delta = scan.element_position_m.copy(), scan.delta_tof_s.copy()
    position[8] = position[7]
    delta[8], delta[:, 8] = delta[7], delta[:, 7]
    delta[8, 7] = delta[7, 8] = 0.0
    assert error(replace(scan, element_position_m=position, delta_tof_s=delta), method) < 1.15 * whole[method]


def residual(*history):
    """Of a result with this history, s."""
    image, grid = np.full((4, 4), 1500.0), ((1e-3, 1e-3), (0.0, 0.0))
    return Reconstruction(image, image, *grid, 1500.0, Settings(), history=history).residual_rms_s


@pytest.mark.parametrize(
    ("given", "first"), [((0, 1, 1, 1), 3e-7), ((0, 1, 1, 0), 2e-7), ((1, 1, 0, 0), 4e-7)]
)
def test_residual_of_slices_that_ended_at_different_sweeps(given, first):
    passes = ((0, 1, 4e-7), (1, 1, 1e-7), (0, 2, 2e-7), (0, 3, 3e-7))
    history = (Iteration(*one, 8, given=bool(flag)) for one, flag in zip(passes, given, strict=True))
    assert residual(*history) == pytest.approx(np.sqrt((first**2 + 1e-14) / 2))


def test_the_residual_is_that_of_the_last_stage_which_gives_the_image():
    last = Iteration(0, 1, 3e-7, 8, stage=1), Iteration(0, 2, 2e-7, 8, stage=1, given=False)
    assert residual(Iteration(0, 1, 1e-7, 8), *last) == pytest.approx(3e-7)
    assert residual() is None
