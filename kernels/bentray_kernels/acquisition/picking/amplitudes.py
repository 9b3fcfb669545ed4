"""Amplitude picking: log ratios of the pulses in water and object, by energy or by the spectral ratio."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...arrays import Floats
from ...errors import InvalidInput
from ..dataset import Dataset
from .first_arrivals import ROUNDING, require_traces
from .gate import Gate

# Frequencies are used where the power of the pulse is this many times that of the noise in both traces.
MIN_SNR = 10.0

# Values with a larger standard deviation are omitted, Np; the total absorption of a breast at 1 MHz is
# similar.
MAX_UNCERTAINTY_NP = 0.5


class Powers(NamedTuple):
    """Power spectra of the pulses of one emission.

    Attributes:
        water, object: (nrx, frequencies), including the noise.
        water_noise, object_noise: (nrx, 1).
        frequency: (frequencies,), relative to the centre frequency.
        noise_correlation: see ``Gate``.
    """

    water: Floats
    object: Floats
    water_noise: Floats
    object_noise: Floats
    frequency: Floats
    noise_correlation: Floats


def read_log_ratios(dataset: Dataset, emissions: Sequence[int], delta_s: Floats, way: str) -> Floats:
    """ln(A_water / A_object) at the centre frequency, of some emissions, from their traces.

    Args:
        dataset: of one slice, see ``picking.first_arrivals.pick``; its traces may be ``Emissions``.
        emissions: indices, from 0.
        delta_s: (emissions, nrx), s: travel time object minus water, which locates the pulse.
        way: a name of ``WAYS``.

    Returns:
        (emissions, nrx), Np; NaN without a time, with an incomplete pulse or too much noise.

    Raises:
        InvalidInput: for an unknown method, without the traces that ``pick`` requires, and as
            ``Gate.from_dataset``.
    """
    if way not in WAYS:
        raise InvalidInput("amplitudes", repr(way), "one of " + ", ".join(WAYS))
    require_traces(dataset)
    traces, water_traces = dataset.traces, dataset.traces.water_traces
    gate, rate = Gate.from_dataset(dataset), dataset.rate_hz
    rounding = ROUNDING if traces.object.dtype.kind == "i" else 0.0
    straight = (dataset.distance_m() / dataset.water_speed_mps - dataset.t0_s) * rate
    ratios = np.empty((len(emissions), len(dataset.rx)))
    for row, e in enumerate(emissions):
        water, water_noise = gate.powers(water_traces[e], straight[e], rounding)
        other, other_noise = gate.powers(traces.object[e], straight[e] + rate * delta_s[row], rounding)
        noises = water_noise[:, None], other_noise[:, None]
        powers = Powers(
            water, other, *noises, gate.frequency_hz / dataset.frequency_hz, gate.noise_correlation
        )
        with np.errstate(all="ignore"):
            value, sigma = WAYS[way](powers)
            if way == "ratio":
                value = value + _gain(traces.water_scale, e) - _gain(traces.object_scale, e)
        ratios[row] = np.where(sigma <= MAX_UNCERTAINTY_NP, value, np.nan)
    ratios[~np.isfinite(ratios)] = np.nan
    return ratios


def with_log_ratios(dataset: Dataset, way: str) -> Dataset:
    """The dataset with log ratios from its traces, at the positions given by its travel times.

    Args:
        dataset: with travel times, and traces of object and water.
        way: see ``read_log_ratios``.

    Raises:
        InvalidInput: as ``read_log_ratios``; without travel times.
    """
    every = range(len(dataset.tx))
    slices = [dataset.slice(k) for k in range(dataset.slices)]
    ratios = [read_log_ratios(slice_data, every, slice_data.differential_tof(), way) for slice_data in slices]
    ratio = ratios[0] if dataset.slice_z_m is None else np.stack(ratios)
    return replace(dataset, log_ratio_np=ratio, amplitude_frequency_hz=dataset.center_frequency_hz)


def log_ratio(powers: Powers) -> tuple[Floats, Floats]:
    """Energy ratio: half the logarithm of the energies minus noise, and its standard deviation, (nrx,) each.

    It includes spreading and focusing as well as absorption; see ``tomography.focusing``.
    """
    energies, variance = [], 0.0
    for power, noise in ((powers.water, powers.water_noise), (powers.object, powers.object_noise)):
        clean = np.where(power.sum(axis=1, keepdims=True) > MIN_SNR * power.shape[1] * noise, power, np.nan)
        energies.append((clean - noise).sum(axis=1))
        height = np.sqrt(power)
        moved = np.einsum("ri,ij,rj->r", height, powers.noise_correlation, height)
        variance = variance + 0.5 * noise[:, 0] * moved / power.sum(axis=1) ** 2
    return 0.5 * np.log(energies[0] / energies[1]), np.sqrt(variance)


def spectral_ratio(powers: Powers) -> tuple[Floats, Floats]:
    """Spectral ratio: log ratio from the slope over frequency, and its standard deviation, (nrx,) each.

    Absorption in proportion to the frequency, a = a0 f, multiplies the spectrum by exp(-f B), B the integral
    of a0 along the ray; frequency-independent losses only add a constant g. So

        ln |W(f) / O(f)| = g + f B

    is a line of slope B (the spectral ratio method; R. Kuc, IEEE Trans. ASSP 32, 1984), and f0 B is the loss
    at the centre frequency. The weight of each frequency is W O / (W + O) of the powers relative to their
    maxima.
    """
    # Where both are well above the noise.
    detected = (powers.water > MIN_SNR * powers.water_noise) & (powers.object > MIN_SNR * powers.object_noise)
    water, other = powers.water - powers.water_noise, powers.object - powers.object_noise
    level = np.where(detected, 0.5 * np.log(water / other), 0.0)
    both = water.max(axis=1, keepdims=True) / water + other.max(axis=1, keepdims=True) / other
    weight = np.where(detected, 1.0 / both, 0.0)
    weight /= weight.sum(axis=1, keepdims=True)
    away = powers.frequency - (weight @ powers.frequency)[:, None]
    share = weight * away / (weight * away**2).sum(axis=1, keepdims=True)
    unsure = np.where(
        detected, 0.5 * (powers.water_noise / powers.water + powers.object_noise / powers.object), 0.0
    )
    moved = share * np.sqrt(unsure)
    sigma = np.sqrt(np.einsum("ri,ij,rj->r", moved, powers.noise_correlation, moved))
    return (share * level).sum(axis=1), np.where(detected.sum(axis=1) > 2, sigma, np.nan)


def _gain(scale: Floats | None, emission: int) -> Floats | float:
    """Logarithm of the scale factors of the traces of an emission."""
    return 0.0 if scale is None else np.asarray(np.log(np.abs(scale[emission])))


WAYS: dict[str, Callable[[Powers], tuple[Floats, Floats]]] = {
    "ratio": log_ratio,
    "spectrum": spectral_ratio,
}
