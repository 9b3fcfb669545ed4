"""A result says that it is doubtful: cut off at a bound, above the noise, or no better than a constant."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.noise import with_noise
from bentray_kernels.tomography import Caution, Reconstruction, Settings, reconstruct
from bentray_kernels.tomography.cautions import attenuation_cautions, bound_cautions, fit_cautions
from bentray_kernels.tomography.result import residual_counts

from ..straight_scans import DATA, chords_m, radar, ring_scan, trunk

ELEMENTS, RADIUS, WATER = 32, 0.08, 1480.0
ORDER = np.random.default_rng(3).permutation(ELEMENTS)


def ring(speed: float = 1520.0, radius: float = 0.02) -> Dataset:
    """Times along straight rays through a disc off the centre."""
    chord = chords_m(ring_scan(ELEMENTS, RADIUS), radius, (0.02, 0.01))
    # A pair of one element holds a wrong time, which another order brings to other pairs.
    np.fill_diagonal(chord, 2.0 * radius)
    return ring_scan(ELEMENTS, RADIUS, chord * (1.0 / speed - 1.0 / WATER), WATER)


def noisy(scan: Dataset, snr: float, seed: int = 0) -> Dataset:
    off = ~np.eye(ELEMENTS, dtype=bool)
    return replace(scan, delta_tof_s=with_noise(scan.delta_tof_s, snr, np.random.default_rng(seed), off)[0])


def changed(scan: Dataset, change) -> Dataset:
    return replace(scan, delta_tof_s=change(scan.delta_tof_s))


def image(scan: Dataset, method: str, **settings) -> Reconstruction:
    # Not examined: impossible times and orders would be refused before.
    return reconstruct(
        scan, Settings.from_values(method=method, **{"nodes": 32, "examine": False, **settings})
    )


def codes(result: Reconstruction) -> list[str]:
    assert bool(result.doubt) == any(caution.doubtful for caution in result.cautions)
    assert result.doubt.startswith("Doubtful result. ") or not result.doubt
    # "uncertainty" is about the deviations, not about the image.
    return [caution.code for caution in result.cautions if caution.code != "uncertainty"]


DISC = ring()
WAY = DISC.distance_m()
GOOD = {
    "a disc": (DISC, {}),
    "a slow disc": (ring(1400.0), {}),
    "noise": (noisy(DISC, 10.0), {}),
    "more noise than the goals": (noisy(DISC, 3.0), {}),
    "a large object in noise": (noisy(ring(1400.0, 0.06), 3.0), {}),
    "wrong picks": (changed(DISC, lambda d: np.where(ORDER[:, None] == ORDER[None, ::-1], 2e-6, d)), {}),
    "wrong picks of one way": (
        changed(DISC, lambda d: np.where(np.tri(32), np.nan, d + 5e-5 * (ORDER[:, None] * ORDER == 99))),
        {},
    ),
    "water": (changed(DISC, lambda d: 0.0 * d), {}),
    "noisy water": (changed(DISC, lambda d: np.random.default_rng(0).normal(0.0, 3e-8, d.shape)), {}),
    "an arc": (replace(DISC, valid=np.add.outer(np.arange(32), np.zeros(32, int)) < 20), {}),
    "bounds at the water": (noisy(DISC, 10.0), {"speed_bounds_mps": (WATER, 1600.0)}),
    "two iterations": (DISC, {"iterations": 2}),
}
BAD = {
    "too fast for the bounds": (changed(DISC, lambda d: 30.0 * d), {}, {"bounds"}),
    "narrow bounds": (DISC, {"speed_bounds_mps": (1470.0, 1490.0)}, {"bounds"}),
    "another order": (changed(DISC, lambda d: d[np.ix_(ORDER, ORDER)]), {}, {"constant"}),
    "another water": (changed(DISC, lambda d: WAY * (1.0 / 1485.0 - 1.0 / WATER)), {}, {"constant"}),
    "water not subtracted": (changed(DISC, lambda d: d + WAY / WATER), {}, {"bounds"}),
    "emitters in another order": (changed(DISC, lambda d: d[ORDER]), {}, {"constant", "noise"}),
    "emitters one on": (changed(DISC, lambda d: np.roll(d, 1, 0)), {}, {"constant", "noise"}),
    "noise": (
        changed(DISC, lambda d: np.random.default_rng(0).normal(0.0, 5e-7, d.shape)),
        {},
        {"constant", "noise"},
    ),
    "one receiver on": (
        changed(DISC, lambda d: np.roll(d + WAY / WATER, 1, 1) - WAY / WATER),
        {},
        {"constant", "noise"},
    ),
}


@pytest.mark.parametrize("method", ["sart", "gauss-newton"])
@pytest.mark.parametrize("name", GOOD)
def test_a_good_image_is_not_doubted(name: str, method: str) -> None:
    scan, settings = GOOD[name]
    assert codes(image(scan, method, **settings)) == []


@pytest.mark.parametrize("method", ["sart", "gauss-newton"])
@pytest.mark.parametrize("name", BAD)
def test_an_image_of_impossible_times_is_doubted(name: str, method: str) -> None:
    scan, settings, expected = BAD[name]
    computed = codes(image(scan, method, **settings))
    assert expected.intersection(computed), computed


@pytest.mark.parametrize(("left", "found"), [(0.4, []), (0.7, ["residual"]), (1.0, ["constant"])])
def test_an_image_that_explains_little_more_than_a_constant_is_doubted(left: float, found: list[str]) -> None:
    scan = ring(1400.0, 0.06)
    delta = scan.delta_tof_s
    over = delta - WAY * (WAY * delta).sum() / (WAY**2).sum()
    history = image(DISC, "sart").history
    cautions = [*fit_cautions(scan, Settings(), residual_counts(left * over), history)]
    assert [one.code for one in cautions if one.doubtful] == found


def test_the_sentences_hold_the_numbers_and_what_to_do() -> None:
    speed = np.full((10, 10), 1500.0)
    speed[0], speed[1, :2] = 1800.0, 1300.0
    coverage = np.ones_like(speed)
    coverage[5:] = 0.0
    (caution,) = bound_cautions(speed, coverage, (1300.0, 1800.0), 1500.0)
    assert caution == Caution("bounds", caution.text, doubtful=True)
    assert "4.0 % of the nodes with rays are at the lowest speed allowed, 1300 m/s" in caution.text
    assert "20.0 % at the highest, 1800 m/s" in caution.text
    assert "widen speed_bounds_mps" in caution.text
    assert not [*bound_cautions(speed[2:], coverage[2:], (1300.0, 1800.0), 1500.0)]
    scan, settings, _ = BAD["another order"]
    text = image(scan, "sart", **settings).doubt
    assert "One constant speed of 148" in text
    assert "explains the times as well as the image" in text


@pytest.mark.parametrize(("part", "less"), [(0.9, None), (0.96, "clearly "), (1.0, ""), (1.2, "")])
def test_an_attenuation_must_be_clearly_better_than_a_constant(part: float, less: str | None) -> None:
    """Of 50 pairs with a misfit of 0.1 Np, 0.869 dB, by the constant."""
    held_out = np.array([50.0, 50.0 * (0.1 * part) ** 2, 50.0 * 0.1**2])
    numbers = f"held-out amplitudes {0.868589 * part:.3g} dB against 0.869 dB."
    text = f"Attenuation not {less}better than a constant: {numbers}"
    expected = [] if less is None else [Caution("attenuation", text)]
    assert [*attenuation_cautions(held_out, 0.1)] == expected
    assert not [*attenuation_cautions(np.zeros(3), 0.1)]
    (layer,) = attenuation_cautions(held_out, 0.5)
    assert layer.text.startswith("Attenuation not better than a constant: first arrivals follow a thin fast")
    assert layer.text.endswith(f"in wrong places ({numbers[:-1]}).")


@pytest.mark.real
def test_the_measured_trunk_and_the_small_radar_profile_are_doubted() -> None:
    """Apparent speeds of 430 to 2,270 m/s, and radar scaled to a tenth, within bounds of tissue."""
    if not DATA.is_dir():
        pytest.skip(f"no measured scans: {DATA} is absent")
    assert codes(image(trunk(), "gauss-newton", rays="straight", decomposition="volume", nodes=20))
    thin = {"penalty_strength": 0.1, "nodes": 48}
    assert codes(image(radar(), "gauss-newton", **thin)) == ["bounds"]
    assert codes(image(radar(), "gauss-newton", speed_bounds_mps=(1000.0, 2500.0), **thin)) == []
