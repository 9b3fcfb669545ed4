"""Standard deviations of nodes cover the error, and grow with noise, missing rays and straight rays."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.phantoms import EllipsePhantom
from bentray_kernels.phantoms.ellipses import Ellipse
from bentray_kernels.task_graph import ThreadPool, run
from bentray_kernels.tomography import Settings, reconstruct
from bentray_kernels.tomography.gauss_newton.linearisation import Rows
from bentray_kernels.tomography.problem import Problem
from bentray_kernels.tomography.reconstruction_graph import ReconstructionGraph, estimate_uncertainty
from bentray_kernels.tomography.scan import MemorySource, Scan
from bentray_kernels.tomography.uncertainty import model_errors
from bentray_kernels.tomography.uncertainty import ray_uncertainty as module
from bentray_kernels.tomography.uncertainty.ray_uncertainty import ray_uncertainty

WATER, SIDE, NODES, RING = 1500.0, 0.16, 48, Ring(48, 0.07)
PLAN = Settings.from_values(method="gauss-newton", nodes=NODES, side_m=SIDE, iterations=3, uncertainty=True)
PHANTOM = EllipsePhantom(
    WATER,
    (
        Ellipse((0.0, 0.0), (0.045, 0.040), 1475.0, 5.0, "fat"),
        Ellipse((0.008, 0.004), (0.022, 0.018), 1520.0, 10.0, "gland"),
        Ellipse((-0.020, -0.010), (0.006, 0.006), 1540.0, 25.0, "lesion"),
    ),
)
EVERYONE = np.arange(RING.elements)


@pytest.fixture(scope="module")
def times():
    return TravelTimeScan(PHANTOM, RING, SIDE, nodes=NODES).delta_tof(EVERYONE)


def scan(times, noise_s=1e-8, keep=None):
    noisy = times + np.random.default_rng(5).normal(0.0, noise_s, times.shape)
    np.fill_diagonal(noisy, np.nan)
    delta = noisy if keep is None else np.where(keep, noisy, np.nan)
    return Dataset(RING.positions(), EVERYONE, EVERYONE, WATER, delta_tof_s=delta)


@pytest.fixture(scope="module")
def image(times):
    return reconstruct(scan(times), PLAN)


def inside():
    return PHANTOM.inside(NODES, SIDE)


def twice(flat):
    """Two slices of the same times."""
    return replace(flat, delta_tof_s=np.stack([flat.delta_tof_s] * 2), slice_z_m=np.array([0.0, 0.002]))


def mean_square(result):
    return float((result.uncertainty[inside()] ** 2).mean())


@pytest.mark.parametrize("noise_s", [1e-8, 6e-8, 4e-7])
def test_most_nodes_lie_within_two_deviations_of_the_smoothed_truth(times, image, noise_s):
    result = image if noise_s == 1e-8 else reconstruct(scan(times, noise_s), PLAN)
    (width,) = result.resolution_width_m
    assert 0.0 < width < 4 * result.spacing_m[0]
    truth = gaussian_filter(PHANTOM.speed(NODES, SIDE), width / result.spacing_m[0], mode="nearest")
    error = np.abs(result.speed - truth)[inside()]
    assert (error < 2.0 * result.uncertainty[inside()]).mean() >= 0.85
    # Not by being useless: the deviations are of the size of the error, and larger where it is.
    assert mean_square(result) < 9.0 * (error**2).mean()
    assert np.corrcoef(error, result.uncertainty[inside()])[0, 1] > 0.2


def test_the_uncertainty_changes_nothing_else(times, image):
    plain = reconstruct(scan(times), PLAN.changed(uncertainty=False))
    assert plain.uncertainty is None
    assert plain.resolution_width_m == ()
    assert np.array_equal(plain.speed, image.speed)
    assert image.image("uncertainty").values.shape == image.speed.shape


def test_errors_of_the_model_are_added(times, monkeypatch):
    squares = []
    for added in (0.0, 400.0):
        monkeypatch.setattr(model_errors.ModelErrors, "added_to", lambda _, known, added=added: known + added)
        squares.append(mean_square(reconstruct(scan(times), PLAN)))
    assert squares[1] - squares[0] == pytest.approx(400.0)


def test_nodes_outside_the_array_are_not_estimated(image):
    assert image.uncertainty[0, 0] == 0.0
    assert np.isfinite(image.uncertainty).all()
    assert image.uncertainty[inside()].min() > 0.0


def test_noise_makes_the_image_coarser_and_missing_rays_make_it_less_certain(times):
    """Where the misfit is noise: below it, errors of the model count."""
    image = reconstruct(scan(times, 6e-8), PLAN)
    noisy = reconstruct(scan(times, 4e-7), PLAN)
    assert noisy.resolution_width_m[0] > image.resolution_width_m[0]
    few = np.zeros(times.shape, bool)
    few[::4, ::4] = True
    sparse = reconstruct(scan(times, 6e-8, keep=few), PLAN)
    assert mean_square(sparse) > 1.5 * mean_square(image)


def test_straight_rays_are_less_certain_than_bent_ones(times, image):
    """The misfit along bent rays shows what straight rays neglect."""
    straight = reconstruct(scan(times), replace(PLAN, rays="straight"))
    assert mean_square(straight) > 1.25 * mean_square(image)


def test_sart_has_an_uncertainty_too_and_slices_have_their_own(times):
    plan = replace(PLAN, method="sart", iterations=2)
    flat = scan(times)
    alone = reconstruct(flat, plan)
    both = reconstruct(twice(flat), plan)
    assert np.array_equal(both.uncertainty[..., 0], alone.uncertainty)
    assert both.resolution_width_m[0] == alone.resolution_width_m[0]
    # The image differs by the order of its emitters, the samples by the slice.
    assert not np.array_equal(both.uncertainty[..., 1], alone.uncertainty)
    assert len(both.resolution_width_m) == 2
    # Nothing calls these images into question.
    assert not alone.caution("uncertainty")


def test_the_result_states_why_its_deviations_may_be_too_small(times, monkeypatch):
    monkeypatch.setattr(model_errors, "MISFIT_OVER_NOISE", 0.01)
    monkeypatch.setattr(model_errors, "MISFIT_CROSSING", 0.0)
    flat = scan(times, 6e-8)
    plan = replace(PLAN, method="sart", iterations=1)
    alone = reconstruct(flat, plan).caution("uncertainty")
    assert alone.startswith("The standard deviations may be too small: bent rays through the image leave")
    assert reconstruct(twice(flat), plan).caution("uncertainty") == f"{alone} (One of 2 of 2 slices.)"
    assert not reconstruct(flat, replace(plan, uncertainty=False)).caution("uncertainty")


def row_sums(residual, noise_s=0.0):
    """The problem of one ray along each row of an image of water, its rays with these residuals, s."""
    nodes = len(residual)
    nowhere = np.zeros((1, 2))
    problem = Problem(
        nowhere,
        nowhere[None],
        np.zeros(1, np.int64),
        np.zeros((1, 1)),
        region=np.ones((nodes, nodes), bool),
        spacing=1e-3,
        origin=(0.0, 0.0),
        water_speed=WATER,
        noise_s=noise_s,
    )
    pointers = nodes * np.arange(nodes + 1, dtype=np.int64)
    columns, lengths = np.arange(nodes**2, dtype=np.int32), np.ones(nodes**2, np.float32)
    return (
        problem,
        PLAN,
        np.full((nodes, nodes), 1.0 / WATER),
        [Rows(pointers, columns, lengths, np.asarray(residual), np.array([nodes]))],
    )


@pytest.fixture
def weights(monkeypatch):
    """Inverse variances that the posterior is given, 1/s²."""
    seen = []

    class Seen(module.Posterior):
        def __init__(self, parts, weights, *others):
            seen.extend(np.concatenate(weights))
            super().__init__(parts, weights, *others)

    monkeypatch.setattr(module, "Posterior", Seen)
    return seen


def test_a_ray_beyond_the_limit_counts_less_by_its_distance_from_it(weights):
    """The Huber weight is influence over residual: 1 within the limit, then limit over size."""
    residual = 1e-8 * np.where(np.arange(16) % 2, 1.0, -1.0)
    residual[[4, 9]] = 1e-7, -2e-7
    ray_uncertainty(*row_sums(residual))
    relative = np.array(weights) / max(weights)
    assert np.count_nonzero(relative == 1.0) == 14
    limit = relative[4] * 1e-7
    assert 1e-8 < limit < 1e-7
    assert relative[9] == pytest.approx(limit / 2e-7)
    # The unit is the root mean square of all residuals, clipped to the limit.
    assert max(weights) == pytest.approx(16.0 / (14 * 1e-8**2 + 2 * limit**2))


@pytest.mark.parametrize(("noise_s", "expected_s"), [(0.0, 1e-8), (4e-9, 1e-8), (3e-8, 3e-8)])
def test_times_are_no_better_than_pairs_measured_both_ways_agree(weights, noise_s, expected_s):
    """An image that follows the noise has a smaller misfit than its data have errors."""
    ray_uncertainty(*row_sums(1e-8 * np.where(np.arange(16) % 2, 1.0, -1.0), noise_s))
    np.testing.assert_allclose(weights, expected_s**-2)


def test_expected_squares_are_those_of_the_smoothed_truth():
    """Of samples of ±2 m/s, twice, about a mean 3 m/s off; a chequered sample does not outlive smoothing."""
    chequers = np.where(np.add.outer(range(24), range(24)) % 2, 2.0, -2.0)
    speed, mean = np.full((24, 24), WATER), np.full((24, 24), 3.0)
    for width, expected in ((0.0, 2.0 * 2.0**2 + 3.0**2), (1.5, 3.0**2)):
        squares, kept = module._squares(speed, mean, [chequers, -chequers], width)
        assert kept == width
        np.testing.assert_allclose(squares[4:-4, 4:-4], expected, rtol=0.01)
    # What smoothing takes from the image itself is an error too.
    squares, _ = module._squares(WATER + chequers, 0.0 * mean, [0.0 * mean], 1.5)
    np.testing.assert_allclose(squares[4:-4, 4:-4], 2.0**2, rtol=0.01)


@pytest.mark.parametrize(("contrast_mps", "least_mps"), [(40.0, 0.15 * 40.0), (4.0, 2.0), (0.0, 2.0)])
def test_the_prior_follows_the_contrast_down_to_a_floor(contrast_mps, least_mps):
    """Of a uniform contrast; the speed and its time differ by the square of the slowness."""
    problem, _, slowness, _ = row_sums(np.zeros(80))
    prior_s = module._prior(problem, slowness - contrast_mps / WATER**2)[40, 40]
    assert prior_s * WATER**2 / problem.spacing == pytest.approx(1.5 * np.hypot(contrast_mps, least_mps))


def test_the_rays_of_the_last_iteration_are_those_of_the_finished_image(times, image):
    """Gauss-Newton has traced them; a resumed run traces them again, with the same bits."""
    graph, again = (ReconstructionGraph(Scan(MemorySource(scan(times)), PLAN), 0) for _ in range(2))
    run({"": graph}, ThreadPool(None))
    assert graph.total == len(graph.history) * RING.elements
    again.restore(replace(graph.checkpoint, values=(None,)))
    run({"": again}, ThreadPool(None))
    assert again.total == graph.total + RING.elements
    for finished in (graph, again):
        assert np.array_equal(finished.value_of(estimate_uncertainty).deviation, image.uncertainty)
