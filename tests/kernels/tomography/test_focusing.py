"""The focusing of a scan's pairs: none in water, more in front of a lens, and what amplitudes lack."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from bentray_kernels import eikonal, rays
from bentray_kernels.acquisition.simulation.fine_medium import log_ratios
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.tomography.focusing import FRESNEL_PART, focusing

NODES, SPACING, WATER = 64, 2e-3, 1500.0
MIDDLE = 0.5 * (NODES - 1) * SPACING


def ring(elements, radius=0.055):
    return MIDDLE + Ring(elements, radius).positions()


def lens(change_mps, width=0.012):
    x = np.arange(NODES) * SPACING - MIDDLE
    return 1.0 / (WATER + change_mps * np.exp(-(x[:, None] ** 2 + x[None, :] ** 2) / (2.0 * width**2)))


def ask(slowness, elements, wavelength=0.0):
    longest = np.linalg.norm(elements[:, None] - elements[None], axis=-1).max()
    return focusing(
        slowness,
        SPACING,
        elements,
        elements,
        wavelength_m=wavelength,
        longest_m=longest,
        eikonal="accurate",
    )


def test_none_in_water():
    assert np.allclose(ask(np.full((NODES, NODES), 1.0 / WATER), ring(7), 1e-3), 0.0, atol=1e-8)


@pytest.mark.parametrize("slowness", [lens(-40.0), lens(40.0)])
def test_a_slow_lens_focuses_and_a_fast_one_spreads(slowness):
    """Through the middle; the farthest receiver hears more or less than in water."""
    across = ask(slowness, ring(8))
    opposite = across[np.arange(8), (np.arange(8) + 4) % 8]
    focuses = slowness.max() > 1.0 / WATER + 1e-9
    assert (np.sign(opposite) == (-1.0 if focuses else 1.0)).all()
    assert np.abs(opposite).min() > 0.05
    assert np.abs(np.diag(across)).max() == 0.0


def test_thin_lens():
    """Weakly refracting media: ½·ln of what a lens of focal length f leaves, 1 − ab/((a + b)·f)."""
    change, width = -4.0, 0.006
    ends = np.array([[MIDDLE - 0.05, MIDDLE], [MIDDLE + 0.05, MIDDLE]])
    # Refracted by the slope of the delay −∫ change/WATER over the ray, whose bend in the middle is 1/f.
    power = -change / WATER * np.sqrt(2.0 * np.pi) / width
    expected = 0.5 * np.log(1.0 - 0.05 * 0.05 / 0.1 * power)
    assert ask(lens(change, width), ends)[0, 1] == pytest.approx(expected, rel=0.05)
    assert abs(expected) > 0.01


def test_smoothed_over_the_fresnel_zone():
    elements, wavelength = ring(6), 6e-3
    longest = np.linalg.norm(elements[:, None] - elements[None], axis=-1).max()
    width = FRESNEL_PART * np.sqrt(wavelength * longest) / SPACING
    smooth = gaussian_filter(lens(60.0, 0.004), width, mode="nearest")
    assert np.allclose(ask(lens(60.0, 0.004), elements, wavelength), ask(smooth, elements), atol=1e-12)
    assert np.abs(ask(smooth, elements)).max() < 0.5 * np.abs(ask(lens(60.0, 0.004), elements)).max()


def test_taken_off_it_leaves_the_line_integrals():
    """Amplitudes made on a grid three times as fine, in a smoothed 2-D breast phantom that absorbs 5 Np/m."""
    phantom, elements = table6(1375.0), ring(24, 0.088) - MIDDLE + 0.5 * TABLE6_SIDE_M

    def sampled(nodes):
        spacing = TABLE6_SIDE_M / (nodes - 1)
        x = np.arange(nodes) * spacing - 0.5 * TABLE6_SIDE_M
        speed = gaussian_filter(phantom.speed_at(x[:, None], x[None, :]), 4e-3 / spacing)
        return spacing, speed, 5.0 * phantom.inside(nodes, TABLE6_SIDE_M)

    spacing, speed, attenuation = sampled(379)
    absorbed, measured = np.empty((4, 24)), np.empty((4, 24))
    for row, source in enumerate(elements[:4]):
        tof = eikonal.solve(speed, spacing, source)
        absorbed[row] = log_ratios(tof, attenuation, spacing, elements, source)
        measured[row] = absorbed[row] - rays.log_amplitudes(tof, speed, spacing, elements, source)
    spacing, speed, _ = sampled(127)
    change = focusing(
        1.0 / speed,
        spacing,
        elements[:4],
        elements,
        wavelength_m=0.0,
        longest_m=0.0,
        eikonal="accurate",
    )
    before = np.sqrt(np.nanmean((measured - absorbed) ** 2))
    after = np.sqrt(np.nanmean((measured - change - absorbed) ** 2))
    assert np.isfinite(change).mean() > 0.95
    assert before > 0.2 * np.sqrt((absorbed**2).mean())
    assert after < 0.1 * before


@pytest.mark.parametrize("wavelength", [-1e-3, float("nan"), float("inf")])
def test_a_wavelength_that_is_no_length_is_rejected(wavelength):
    with pytest.raises(InvalidInput, match=r"^wavelength_m: found"):
        ask(lens(10.0), ring(3), wavelength)
