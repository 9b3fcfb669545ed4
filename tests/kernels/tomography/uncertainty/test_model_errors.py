"""Errors of the model grow with contrast and guided rays, and call an image into question."""

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


def test_even_rays_through_a_flat_image_add_nothing():
    plain = errors(speed=np.full(SPEED.shape, WATER))
    assert plain.added_to(np.full(SPEED.shape, 9.0))[np.hypot(X, Y) < 0.7] == pytest.approx(9.0, rel=0.02)
    assert plain.caution == ""


def test_a_layer_that_guides_rays_is_uncertain_by_its_contrast():
    even, guided = errors(), errors(GATHERED)
    assert even.guided < 0.05
    assert guided.guided > 0.5
    known, added = (np.sqrt(each.added_to(np.zeros(SPEED.shape))) for each in (even, guided))
    # Of about 50 m/s of contrast.
    assert 8.0 < known[SKIN].mean() < 18.0
    assert added[SKIN].mean() > 1.3 * known[SKIN].mean()
    assert added[np.hypot(X, Y) < 0.2].max() < 1.0
    assert "thin fast layer" in guided.caution
    assert "misfit" not in guided.caution


def test_rays_that_gather_where_the_image_is_flat_are_no_layer():
    flat = errors(GATHERED, speed=np.full(SPEED.shape, WATER))
    assert flat.guided == 0.0
    assert flat.slower == 0.0
    assert flat.added_to(np.zeros(SPEED.shape)).max() == 0.0


def test_a_misfit_is_called_into_question_if_it_is_above_the_noise_and_above_errors_of_the_grid():
    assert "leave a misfit of 200 ns, 4.0 times the noise" in errors(misfit_s=2e-7).caution
    assert errors(misfit_s=2e-7, noise_s=1.5e-7).caution == ""
    assert errors(misfit_s=2e-8, noise_s=2e-9).caution == ""
    # Without pairs measured both ways it may be noise.
    assert errors(misfit_s=2e-7, noise_s=0.0).caution == ""


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


def test_errors_are_added_by_their_equation():
    """Of 9 (m/s)² of the posterior, a contrast of 10 m/s and rays half as many again as around."""
    even = np.ones((8, 8))
    plain = ModelErrors(10.0 * even, 0.5 * even, 0.4, 0.0, 0.0, 1.0, 1.0)
    assert plain.added_to(9.0 * even) == pytest.approx(1.5**2.5 * (9.0 + 0.1 * 100.0) + 1.25 * 0.4**4 * 100.0)
    # The excess is that of the node itself, squares are averaged.
    node = np.zeros((8, 8))
    node[4, 4] = 1.0
    single = ModelErrors(0.0 * even, node, 0.0, 0.0, 0.0, 1.0, 1.0).added_to(9.0 * node)
    assert single[4, 4] / single[3, 4] == pytest.approx(2.0**2.5 * np.exp(0.5 / 0.75**2), rel=0.01)


def test_contrast_and_excess_of_rays_are_measured_by_their_definitions():
    """A chequered image, whose surroundings are water, and rays gathered in waves of six nodes."""
    chequers = WATER + 20.0 * np.where(np.add.outer(range(NODES), range(NODES)) % 2, 1.0, -1.0)
    everywhere, wave = np.ones((NODES, NODES), bool), 2.0 * np.pi / 6.0
    density = 5.0 + np.sin(wave * (np.arange(NODES) + 0.5))[:, None] * np.ones(NODES)
    result = ModelErrors.from_misfit(chequers, everywhere, density, 1e-8, 2e-8, SPACING_M, WATER)
    assert (result.contrast**2).mean() == pytest.approx(20.0**2, rel=0.01)
    # A fifth of the mean, as far as the count of rays shows the wave; half of it is excess.
    assert result.guided == pytest.approx(0.2 * np.exp(-0.5 * (0.75 * wave) ** 2) / 2.0, rel=0.1)
    doubled = ModelErrors.from_misfit(
        2.0 * chequers - WATER, everywhere, density, 1e-8, 2e-8, SPACING_M, WATER
    )
    assert doubled.guided == pytest.approx(result.guided)
    assert doubled.contrast == pytest.approx(2.0 * result.contrast)
