"""How much weaker the pulse of each pair is than in water: by its height, or by its spectrum alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ...errors import InvalidInput
from ..dataset import Dataset
from .first_arrivals import ROUNDING, require_traces
from .gate import Gate

# Frequencies count where the power of the pulse is this many times that of the noise in both traces.
LEAST_SNR = 10.0

# Values whose standard deviation is larger are left out, Np: a breast absorbs about as much at 1 MHz.
MOST_UNSURE_NP = 0.5


class Powers(NamedTuple):
    """Of the pulses of one emission.

    Attributes:
        water, object: (nrx, frequencies), with the noise in them.
        water_noise, object_noise: (nrx, 1).
        frequency: (frequencies,), over the centre frequency.
        alike: see ``Gate``.
    """

    water: Floats
    object: Floats
    water_noise: Floats
    object_noise: Floats
    frequency: Floats
    alike: Floats


def read_log_ratios(dataset: Dataset, emissions: Sequence[int], delta_s: Floats, way: str) -> Floats:
    """ln(A_water / A_object) at the centre frequency, of some emissions, from their traces.

    Args:
        dataset: of one slice, see ``picking.first_arrivals.pick``; its traces may be ``Emissions``.
        emissions: which, counted from 0.
        delta_s: (emissions, nrx), s: travel time object minus water, which says where the pulse lies.
        way: a name of ``WAYS``.

    Returns:
        (emissions, nrx), Np; NaN where there is no time, the pulse is not whole or the noise too loud.

    Raises:
        InvalidInput: for another way, without what ``pick`` needs, and as ``Gate.of``.
    """
    if way not in WAYS:
        raise InvalidInput("amplitudes", repr(way), "one of " + ", ".join(WAYS))
    require_traces(dataset)
    traces = dataset.waveform
    assert traces is not None
    assert traces.water is not None
    assert dataset.sampling_rate_hz is not None
    assert dataset.center_frequency_hz is not None
    gate, rate = Gate.of(dataset), dataset.sampling_rate_hz
    rounding = ROUNDING if traces.object.dtype.kind == "i" else 0.0
    straight = (dataset.distance_m() / dataset.water_speed_mps - dataset.t0_s) * rate
    found = np.empty((len(emissions), len(dataset.rx)))
    for row, e in enumerate(emissions):
        water, water_noise = gate.powers(traces.water[e], straight[e], rounding)
        other, other_noise = gate.powers(traces.object[e], straight[e] + rate * delta_s[row], rounding)
        noises = water_noise[:, None], other_noise[:, None]
        powers = Powers(water, other, *noises, gate.frequency_hz / dataset.center_frequency_hz, gate.alike)
        with np.errstate(all="ignore"):
            value, sigma = WAYS[way](powers)
            if way == "ratio":
                value = value + _gain(traces.water_scale, e) - _gain(traces.object_scale, e)
        found[row] = np.where(sigma <= MOST_UNSURE_NP, value, np.nan)
    found[~np.isfinite(found)] = np.nan
    return found


def with_log_ratios(dataset: Dataset, way: str) -> Dataset:
    """The dataset with log ratios from its traces, where its travel times say that the pulses lie.

    Args:
        dataset: with travel times beside traces of object and water.
        way: see ``read_log_ratios``.

    Raises:
        InvalidInput: as ``read_log_ratios``; without travel times.
    """
    every = range(len(dataset.tx))
    parts = [dataset.slice(k) for k in range(dataset.slices)]
    found = [read_log_ratios(one, every, one.differential_tof(), way) for one in parts]
    ratio = found[0] if dataset.slice_z_m is None else np.stack(found)
    return replace(dataset, log_ratio_np=ratio, amplitude_frequency_hz=dataset.center_frequency_hz)


def log_ratio(powers: Powers) -> tuple[Floats, Floats]:
    """By the height of the pulse: half the logarithm of the energies, less the noise's, (nrx,) each.

    Spreading and focusing are in it as well as absorption; see ``tomography.focusing``.
    """
    energies, variance = [], 0.0
    for power, noise in ((powers.water, powers.water_noise), (powers.object, powers.object_noise)):
        clean = np.where(power.sum(axis=1, keepdims=True) > LEAST_SNR * power.shape[1] * noise, power, np.nan)
        energies.append((clean - noise).sum(axis=1))
        height = np.sqrt(power)
        moved = np.einsum("ri,ij,rj->r", height, powers.alike, height)
        variance = variance + 0.5 * noise[:, 0] * moved / power.sum(axis=1) ** 2
    return 0.5 * np.log(energies[0] / energies[1]), np.sqrt(variance)


def spectral_ratio(powers: Powers) -> tuple[Floats, Floats]:
    """By how much more high frequencies have lost than low ones, (nrx,) each.

    Absorption in proportion to the frequency, a = a0 f, leaves of each frequency exp(-f B), B the integral of
    a0 along the ray, whatever else made the pulse weaker for all frequencies alike. So

        ln |W(f) / O(f)| = g + f B

    is a line whose slope is B (the spectral ratio method; R. Kuc, IEEE Trans. ASSP 32, 1984), and f0 B what
    the centre frequency has lost. Each frequency weighs as it is sure, W O / (W + O) of the powers over their
    highest.
    """
    water, other, heard = _clean(powers)
    level = np.where(heard, 0.5 * np.log(water / other), 0.0)
    both = water.max(axis=1, keepdims=True) / water + other.max(axis=1, keepdims=True) / other
    weight = np.where(heard, 1.0 / both, 0.0)
    weight /= weight.sum(axis=1, keepdims=True)
    away = powers.frequency - (weight @ powers.frequency)[:, None]
    share = weight * away / (weight * away**2).sum(axis=1, keepdims=True)
    unsure = np.where(
        heard, 0.5 * (powers.water_noise / powers.water + powers.object_noise / powers.object), 0.0
    )
    moved = share * np.sqrt(unsure)
    sigma = np.sqrt(np.einsum("ri,ij,rj->r", moved, powers.alike, moved))
    return (share * level).sum(axis=1), np.where(heard.sum(axis=1) > 2, sigma, np.nan)


def _clean(powers: Powers) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Powers of the pulses of water and object less the noise's, and where both are heard well above it."""
    heard = (powers.water > LEAST_SNR * powers.water_noise) & (
        powers.object > LEAST_SNR * powers.object_noise
    )
    return powers.water - powers.water_noise, powers.object - powers.object_noise, heard


def _gain(scale: Floats | None, emission: int) -> Floats | float:
    """Logarithm of the factors of the traces of an emission."""
    return 0.0 if scale is None else np.asarray(np.log(np.abs(scale[emission])))


WAYS: dict[str, Callable[[Powers], tuple[Floats, Floats]]] = {
    "ratio": log_ratio,
    "spectrum": spectral_ratio,
}
