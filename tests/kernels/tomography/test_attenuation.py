"""Attenuation: recovered from line integrals; gaps and water count; SART of it by hand, in its bounds."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.tomography import Problem, Settings, reconstruct, rmse
from bentray_kernels.tomography.attenuation import active_emitters, trace_rays, validate
from bentray_kernels.tomography.attenuation_sart import solve
from bentray_kernels.tomography.focusing import focusing
from bentray_kernels.tomography.reconstruction_graph import solve_attenuation
from bentray_kernels.tomography.scan import MemorySource, Scan
from bentray_kernels.tomography.stage_graphs import batches_of
from bentray_kernels.tomography.uncertainty.model_errors import GUIDED

from ...table6 import table6_scan
from .gauss_newton.test_linear_problem import rows_of

NODES, SIDE, WATER = 64, TABLE6_SIDE_M, 1375.0
PHANTOM = table6(WATER)
TRUTH, INSIDE = PHANTOM.attenuation(NODES, SIDE), PHANTOM.inside(NODES, SIDE)
RING = Ring(64, 0.09)


@pytest.fixture(scope="module")
def scan():
    return replace(table6_scan(RING.elements, NODES, attenuation=True), water_attenuation_np_m=0.0)


def plan(method="gauss-newton", **changes):
    return Settings.from_values(method=method, nodes=NODES, side_m=SIDE, **changes)


@pytest.mark.parametrize("method", [pytest.param("sart", marks=pytest.mark.nightly), "gauss-newton"])
def test_line_integrals_give_it_back(scan, method):
    result = reconstruct(scan, plan(method))
    assert result.attenuation.min() >= 0.0
    assert rmse(result.attenuation, TRUTH, INSIDE) < 0.16 * (TRUTH.max() - TRUTH.min())


def test_sart_gives_it_back_too(scan):
    sart = plan("sart", attenuation_solver="sart")
    result = reconstruct(scan, sart)
    results = rmse(result.attenuation, TRUTH, INSIDE)
    constant = TRUTH[INSIDE].std()
    assert result.attenuation.min() >= 0.0
    assert results < 0.6 * constant
    image, same = map(float, re.findall(r"(\S+) dB", result.provenance["attenuation"]))
    assert image < 0.5 * same
    assert rmse(reconstruct(scan, sart.changed(iterations=1)).attenuation, TRUTH, INSIDE) > results
    # The order of the emitters alone depends on the seed.
    again, other = (reconstruct(scan, sart.changed(seed=seed)).attenuation for seed in (0, 1))
    np.testing.assert_array_equal(again, result.attenuation)
    assert 0.0 < np.abs(other - again).max() < 0.5 * TRUTH.max()


def test_ratios_from_traces_are_smoothed_more(scan):
    rng = np.random.default_rng(3)
    shape = scan.log_ratio_np.shape
    # As waves have it: larger than the absorption, and here and there far more.
    spread = 2.0 * scan.log_ratio_np[inside_ring(scan)].std() * np.where(rng.random(shape) < 0.1, 4.0, 1.0)
    noise = spread * rng.standard_normal(shape)
    loud = replace(scan, log_ratio_np=scan.log_ratio_np + noise, amplitude_frequency_hz=5e5)
    quick = plan("sart", rays="straight", iterations=1)
    recorded, read = (
        rmse(reconstruct(loud, quick.changed(amplitudes=way)).attenuation, TRUTH, INSIDE)
        for way in ("recorded", "spectrum")
    )
    assert read < 0.7 * recorded
    assert read < 0.2 * (TRUTH.max() - TRUTH.min())


@pytest.mark.nightly
@pytest.mark.parametrize("rays", ["straight", "curved"])
def test_smoothing_of_trace_ratios_does_not_depend_on_the_grid(scan, rays):
    """The penalty is in metres: grids see the same image, each at its own nodes."""
    heard = replace(scan, amplitude_frequency_hz=2e5)
    coarse, fine = (
        reconstruct(heard, replace(plan("sart", rays=rays, iterations=2, amplitudes="ratio"), nodes=nodes))
        for nodes in (NODES // 2, NODES)
    )
    # Both have their first node at the same corner.
    nodes = np.arange(NODES // 2) * coarse.spacing_m[0] / fine.spacing_m[0]
    there = map_coordinates(
        fine.attenuation, np.meshgrid(nodes, nodes, indexing="ij"), order=1, mode="nearest"
    )
    apart = np.abs(there - coarse.attenuation)
    assert apart.max() < 0.12 * there.max()
    assert apart.mean() < 0.03 * there.max()


def inside_ring(scan):
    """Pairs of different elements."""
    return scan.tx[:, None] != scan.rx[None, :]


def test_amplitudes_far_off_count_less(scan):
    rng = np.random.default_rng(7)
    wrong = rng.random(scan.log_ratio_np.shape) < 0.05
    bad = replace(
        scan, log_ratio_np=scan.log_ratio_np + np.where(wrong, rng.normal(0.0, 3.0, wrong.shape), 0.0)
    )
    plain, robust = (
        rmse(reconstruct(bad, plan(huber_scale=spreads)).attenuation, TRUTH, INSIDE) for spreads in (0.0, 3.0)
    )
    assert robust < 0.8 * plain


def test_a_slice_without_amplitudes_has_that_of_the_water(scan):
    ratios = np.stack([scan.log_ratio_np, np.full_like(scan.log_ratio_np, np.nan)])
    times = np.stack([scan.delta_tof_s] * 2)
    both = replace(scan, delta_tof_s=times, log_ratio_np=ratios, slice_z_m=np.array([0.0, 0.01]))
    both = replace(both, water_attenuation_np_m=0.3)
    result = reconstruct(both, plan("sart", iterations=1)).attenuation
    assert np.allclose(result[..., 1], 0.3)
    assert np.ptp(result[..., 0]) > 1.0


@pytest.mark.nightly
def test_along_straight_rays_it_is_worse(scan):
    bent, straight = (reconstruct(scan, plan(rays=rays)).attenuation for rays in ("curved", "straight"))
    assert rmse(bent, TRUTH, INSIDE) < 0.9 * rmse(straight, TRUTH, INSIDE)


def test_a_medium_like_its_water_is_found_to_be_so(scan):
    """Ratios of 0 in lossy water mean that loss everywhere."""
    same = replace(
        scan,
        delta_tof_s=np.zeros_like(scan.delta_tof_s),
        log_ratio_np=np.zeros_like(scan.log_ratio_np),
        water_attenuation_np_m=2.0,
    )
    assert np.allclose(reconstruct(same, plan()).attenuation, 2.0, atol=1e-3)


@pytest.mark.nightly
def test_gaps_in_the_amplitudes_are_only_gaps(scan):
    kept = np.random.default_rng(1).random(scan.log_ratio_np.shape) < 0.2
    gaps = replace(scan, log_ratio_np=np.where(kept, scan.log_ratio_np, np.nan))
    result = reconstruct(gaps, plan())
    assert np.array_equal(result.speed, reconstruct(scan, plan()).speed)
    assert rmse(result.attenuation, TRUTH, INSIDE) < 0.25 * (TRUTH.max() - TRUTH.min())


def test_attenuation_is_optional(scan):
    assert reconstruct(scan, plan(attenuation=False, iterations=1)).attenuation is None
    assert reconstruct(replace(scan, log_ratio_np=None), plan(iterations=1)).attenuation is None


def test_focusing_is_taken_off(scan):
    """Amplitudes that a smooth lens focuses: without the correction they read as absorption or gain."""
    problem = Problem.from_dataset(replace(scan, amplitude_frequency_hz=5e5), plan())
    slowness = 1.0 / PHANTOM.speed(NODES, SIDE)
    lens = focusing(
        slowness,
        problem.spacing,
        problem.emitters,
        problem.receivers[0],
        wavelength_m=problem.wavelength_m,
        longest_m=problem.longest_m,
        eikonal="accurate",
    )
    bent = replace(problem, log_ratio=problem.log_ratio + lens)
    some = np.arange(4)
    plain = trace_rays(problem, plan(), slowness, some)
    lensed = trace_rays(bent, plan(), slowness, some)
    mended = trace_rays(bent, plan(focusing=True), slowness, some)
    assert np.abs(lensed.residual - plain.residual).max() > 0.1
    assert len(mended.residual) <= len(plain.residual)
    assert np.isin(np.round(mended.residual, 9), np.round(plain.residual, 9)).all()


def test_focusing_does_not_depend_on_emitter_batches(scan):
    """A receiver that one emitter alone is far from."""
    few = replace(
        scan,
        rx=scan.rx[:8],
        delta_tof_s=scan.delta_tof_s[:, :8],
        log_ratio_np=scan.log_ratio_np[:, :8],
        amplitude_frequency_hz=5e5,
    )
    settings = plan(focusing=True, reciprocity=False)
    problem = Problem.from_dataset(few, settings)
    slowness = 1.0 / PHANTOM.speed(NODES, SIDE)
    near, far = np.array([12]), np.array([12, 36])
    alone, together = (trace_rays(problem, settings, slowness, emitters) for emitters in (near, far))
    assert np.array_equal(alone.residual, together.residual[: alone.residual.size])


def test_an_image_that_predicts_amplitudes_no_better_than_a_constant_is_doubted(scan):
    quick = plan("sart", rays="straight", iterations=1)
    good = reconstruct(scan, quick)
    said = re.search(r"; held-out amplitudes (\S+) dB against (\S+) dB$", good.provenance["attenuation"])
    assert good.caution("attenuation") == ""
    assert float(said[1]) < 0.5 * float(said[2])
    noise = 1.0 + np.random.default_rng(0).standard_normal(scan.log_ratio_np.shape)
    mixed = reconstruct(replace(scan, log_ratio_np=noise), quick)
    worse = r"Attenuation not (clearly )?better than a constant: held-out amplitudes \S+ dB against \S+ dB\."
    assert re.fullmatch(worse, mixed.caution("attenuation"))
    # No amplitude of a view across the object.
    near = reconstruct(
        replace(scan, log_ratio_np=np.where(scan.distance_m() < RING.radius_m, noise, np.nan)), quick
    )
    assert "held-out" not in near.provenance["attenuation"]
    assert near.caution("attenuation") == ""


def test_an_image_of_amplitudes_along_a_thin_fast_layer_is_doubted(scan):
    """Rays through a ring of 1650 m/s gather in it, and predict each other."""
    whole = Scan(MemorySource(scan), plan())
    problem = whole.problem(0)
    away = np.hypot(*(np.indices(problem.region.shape) - 0.5 * (NODES - 1)))
    layer = np.where(np.abs(away - 0.33 * NODES) < 1.5, 1650.0, WATER)
    for speed, guided in ((layer, True), (PHANTOM.speed(NODES, SIDE), False)):
        rows = [
            trace_rays(problem, plan(), 1.0 / speed, part) for part in batches_of(active_emitters(problem))
        ]
        losses = solve_attenuation(whole, 0, 1.0 / speed, rows)
        assert (losses.guided >= GUIDED) is guided
        assert losses.held_out[1] < losses.held_out[2]


@pytest.mark.parametrize("solver", ["penalised", "sart"])
def test_held_out_amplitudes_are_not_fitted(scan, solver):
    settings = plan("sart", rays="straight", attenuation_solver=solver)
    problem = Problem.from_dataset(replace(scan, water_attenuation_np_m=2.0), settings)
    water = np.full(problem.region.shape, 1.0 / WATER)
    blocks = [trace_rays(problem, settings, water, part) for part in np.split(np.arange(RING.elements), 4)]
    # An attenuation of 7 Np/m more than that of the water, and held-out amplitudes 1 Np above it.
    same = [replace(part, residual=part.project(7.0 * problem.spacing * problem.region)) for part in blocks]
    held = np.arange(sum(part.residual.size for part in blocks)) % 5 == 0
    ends = np.cumsum([part.residual.size for part in blocks])[:-1]
    off = [
        replace(part, residual=part.residual + more)
        for part, more in zip(same, np.split(held, ends), strict=True)
    ]
    count, image, constant = validate(problem, settings, off, ~held, held)
    assert count == held.sum()
    assert constant == pytest.approx(count, rel=1e-4)
    assert image == pytest.approx(count, rel=0.3)


def test_a_pair_of_one_element_is_ignored(scan):
    loud = scan.log_ratio_np.copy()
    np.fill_diagonal(loud, 50.0)
    plain, own = (reconstruct(s, plan(iterations=1)) for s in (scan, replace(scan, log_ratio_np=loud)))
    assert np.array_equal(plain.attenuation, own.attenuation)


@pytest.mark.parametrize("needing", [{"rays": "straight", "amplitudes": "ratio"}, {"focusing": True}])
def test_amplitudes_from_traces_and_focusing_need_a_frequency(scan, needing):
    with pytest.raises(InvalidInput, match=r"^amplitude@frequency_hz: found"):
        reconstruct(scan, plan("sart", iterations=1, **needing))


SHAPE, BOUNDS = (6, 5), (0.0, 9.0)
EVERYWHERE = np.ones(SHAPE, bool)


def sart_plan(**changes):
    return Settings.from_values(method="sart", smoothing_nodes=0.0, **changes)


def crossing(rays, seed=0):
    """Random rays, each through a third of the nodes."""
    random = np.random.default_rng(seed)
    return random.random((rays, 30)) * (random.random((rays, 30)) < 0.3)


@pytest.mark.parametrize("node", [1.0, 0.02], ids=["long rays", "rays shorter than a node"])
def test_one_emitter_follows_equation_1(node):
    matrix, residual = node * crossing(4), node * np.array([1.0, 0.5, 2.0, 0.2])
    water = np.full(SHAPE, 0.3)
    solution = solve(
        [rows_of(matrix, residual, [4])], water, EVERYWHERE, sart_plan(iterations=1, relaxation=0.5), BOUNDS
    )
    corrections, sums = residual / matrix.sum(axis=1), matrix.sum(axis=0)
    update = np.where(sums > 0.0, corrections @ matrix / np.where(sums > 0.0, sums, 1.0), 0.0)
    np.testing.assert_allclose(solution.ravel(), 0.3 + 0.5 * update, atol=1e-6)


def test_emitters_follow_each_other_in_random_order():
    matrix, residual = crossing(6), np.linspace(0.2, 1.2, 6)
    water = np.zeros(SHAPE)
    together = [rows_of(matrix, residual, [2, 4])]
    apart = [rows_of(matrix[:2], residual[:2], [2]), rows_of(matrix[2:], residual[2:], [4])]
    results = [
        solve(parts, water, EVERYWHERE, sart_plan(iterations=3), BOUNDS) for parts in (together, apart)
    ]
    np.testing.assert_array_equal(*results)
    orders = {
        solve(together, water, EVERYWHERE, sart_plan(iterations=1, seed=k), BOUNDS).tobytes()
        for k in range(8)
    }
    assert len(orders) == 2


@pytest.mark.parametrize("smoothing", [0.0, 1.0])
def test_the_true_image_stays_and_is_found(smoothing):
    truth = np.random.default_rng(1).random(SHAPE) if smoothing == 0.0 else np.full(SHAPE, 0.7)
    matrix = np.float32(crossing(200, 2)).astype(float)
    parts = [rows_of(matrix, matrix @ (truth - 0.5).ravel(), [50] * 4)]
    settings = sart_plan(iterations=400, relaxation=1.0).changed(smoothing_nodes=smoothing)
    solution = solve(parts, np.full(SHAPE, 0.5), EVERYWHERE, settings, BOUNDS)
    np.testing.assert_allclose(solution, truth, atol=2e-3)


def test_region_and_bounds_hold():
    region = np.zeros(SHAPE, bool)
    region[2:4] = True
    parts = [rows_of(crossing(20), np.full(20, -50.0), [10, 10])]
    solution = solve(parts, np.full(SHAPE, 0.4), region, sart_plan(iterations=20), BOUNDS)
    assert (solution[~region] == 0.4).all()
    assert solution[region].min() == 0.0
    parts = [rows_of(crossing(20), np.full(20, 500.0), [0, 10, 10, 0])]
    solution = solve(parts, np.full(SHAPE, 0.4), region, sart_plan(iterations=20), BOUNDS)
    assert solution[region].max() == 9.0
