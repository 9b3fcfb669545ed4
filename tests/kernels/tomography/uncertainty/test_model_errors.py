"""Errors of the model grow with guided rays and misfit above the noise, and call an image into question."""

from itertools import pairwise

import numpy as np
import pytest

from bentray_kernels.tomography.uncertainty.model_errors import ModelErrors

NODES, WATER, SPACING_M = 48, 1500.0, 2.4e-3
X, Y = np.meshgrid(*(np.linspace(-1.0, 1.0, NODES),) * 2, indexing="ij")
REGION = np.hypot(X, Y) < 0.9
SKIN = np.abs(np.hypot(X, Y) - 0.6) < 0.03
SPEED = np.where(SKIN, WATER + 60.0, WATER)
EVEN, GATHERED = np.where(REGION, 5.0, 0.0), np.where(SKIN, 15.0, np.where(REGION, 5.0, 0.0))


def errors(density=EVEN, noise_s=5e-8, misfit_s=5e-8, speed=SPEED):
    return ModelErrors.from_misfit(speed, REGION, density, noise_s, misfit_s, SPACING_M, WATER)


def test_noise_through_even_rays_adds_almost_nothing():
    plain = errors()
    assert plain.unexplained == 0.0
    assert plain.guided < 0.05
    assert plain.added_to(np.full(SPEED.shape, 9.0))[REGION].mean() == pytest.approx(9.0, rel=0.2)
    assert plain.caution == ""


def test_a_layer_that_guides_rays_is_uncertain_by_its_contrast():
    guided = errors(GATHERED)
    assert guided.guided > 0.5
    added = np.sqrt(guided.added_to(np.zeros(SPEED.shape)))
    far = REGION & (np.hypot(X, Y) < 0.2)
    # Of about 50 m/s of contrast; behind it, a part of the mean.
    assert 15.0 < added[SKIN].mean() < 40.0
    mean_square = (guided.contrast[REGION] ** 2).mean()
    assert added[far].mean() == pytest.approx(np.sqrt(0.1 * guided.guided * mean_square), rel=0.1)
    assert "thin fast layer" in guided.caution
    assert "misfit" not in guided.caution


def test_rays_that_gather_where_the_image_is_flat_are_no_layer():
    flat = errors(GATHERED, speed=np.full(SPEED.shape, WATER))
    assert flat.guided == 0.0
    assert flat.slower == 0.0
    assert flat.added_to(np.zeros(SPEED.shape)).max() == 0.0


def test_a_misfit_above_the_noise_enlarges_all_of_it():
    squares = np.full(SPEED.shape, 9.0)
    sizes = [errors(misfit_s=times * 5e-8).added_to(squares) for times in (1.0, 1.5, 3.0, 30.0)]
    for less, more in pairwise(sizes):
        assert (more > less).all()
    flat = REGION & (np.hypot(X, Y) < 0.2)
    assert sizes[-1][flat].mean() == pytest.approx(2.5 * 9.0, rel=0.05)


def test_a_misfit_is_called_into_question_if_it_is_above_the_noise_and_above_errors_of_the_grid():
    assert "leave a misfit of 200 ns, 4.0 times the noise" in errors(misfit_s=2e-7).caution
    assert errors(misfit_s=2e-7, noise_s=1.5e-7).caution == ""
    assert errors(misfit_s=2e-8, noise_s=2e-9).caution == ""


def test_an_object_that_is_much_slower_than_the_water_may_be_in_a_shadow():
    """Its size does not count, nor the water around it, nor a small part that is slower still."""
    for radius in (0.2, 0.6):
        inside = np.hypot(X, Y) < radius
        slow = np.where(inside, 1400.0, WATER)
        assert "slower than the water by 6.7 %" in errors(speed=slow).caution
        assert errors(speed=np.where(inside, 1440.0, WATER)).caution == ""
        assert errors(speed=np.where(inside, 1600.0, WATER)).caution == ""
        slow[inside & (np.hypot(X, Y) > 0.25 * radius)] = 1440.0
        assert slow.min() == 1400.0
        assert errors(speed=slow).caution == ""


def test_without_pairs_measured_both_ways_a_misfit_is_no_evidence():
    """It may be noise; the deviations are those of a misfit that is not."""
    unknown = errors(noise_s=0.0, misfit_s=2e-7)
    assert unknown.unexplained == 1.0
    assert unknown.caution == ""


def test_errors_are_added_by_their_equation():
    """Of 9 (m/s)² of the posterior, a contrast of 10 m/s, and a mean square of 40 (m/s)²."""
    plain = ModelErrors(np.array(10.0), 40.0, 0.5, 0.0, 0.25, 0.0, 1.0, 1.0)
    assert plain.added_to(np.array(9.0)) == pytest.approx(1.375 * 9.0 + 0.4 * 0.75 * 100.0 + 0.1 * 0.5 * 40.0)


def test_contrast_misfit_and_excess_of_rays_are_measured_by_their_definitions():
    """A chequered image, whose surroundings are water, and rays gathered in waves of six nodes."""
    chequers = WATER + 20.0 * np.where(np.add.outer(range(NODES), range(NODES)) % 2, 1.0, -1.0)
    everywhere, wave = np.ones((NODES, NODES), bool), 2.0 * np.pi / 6.0
    density = 5.0 + np.sin(wave * (np.arange(NODES) + 0.5))[:, None] * np.ones(NODES)
    result = ModelErrors.from_misfit(chequers, everywhere, density, 1e-8, 2e-8, SPACING_M, WATER)
    assert result.mean_square == pytest.approx(20.0**2, rel=0.01)
    # Of the variance, three quarters are not noise.
    assert result.unexplained == pytest.approx(0.75**2)
    # A fifth of the mean, as far as the count of rays shows the wave; half of it is excess.
    assert result.guided == pytest.approx(0.2 * np.exp(-0.5 * (0.75 * wave) ** 2) / 2.0, rel=0.1)
    doubled = ModelErrors.from_misfit(
        2.0 * chequers - WATER, everywhere, density, 1e-8, 2e-8, SPACING_M, WATER
    )
    assert (doubled.guided, doubled.mean_square) == pytest.approx((result.guided, 4.0 * result.mean_square))
