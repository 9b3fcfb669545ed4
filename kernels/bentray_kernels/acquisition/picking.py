"""First arrivals of a whole scan: travel time object minus water, read from its traces."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..errors import InvalidInput
from .consistency import consistent
from .dataset import Dataset, Floats, Waveform
from .differential import emission
from .onset import AIC, THRESHOLD

PICKERS = {"aic": AIC, "threshold": THRESHOLD}

# Standard deviation of rounding to whole numbers.
ROUNDING = 1.0 / math.sqrt(12.0)

# A delay is not known better than this part of a sample, whatever the noise.
FINEST = 0.02


def pick(
    dataset: Dataset, picker: str = "aic", progress: Callable[[int, int], None] | None = None
) -> Dataset:
    """Read the travel times of a scan from its traces.

    The water and the object trace of a pair are picked in the same way, so that the shape of the pulse
    and the delay of the electronics cancel. The water onset is sought about the straight time at the
    water's speed, the object onset where speeds from 1300 to 1700 m/s put it. The delay between the two
    is then refined: the first one and a half periods of the water pulse are correlated with the object
    trace, to a fraction of a sample. Pairs are left out (NaN) that are nearer than two wavelengths, have
    no pulse above five times the noise, do not resemble the water pulse, or contradict their neighbours
    or their own reverse by more than half a period.

    The standard deviation is sqrt(1 − ρ²) / (2π f ρ), with ρ the likeness and f the centre frequency:
    what differs from the water pulse is counted as noise at that frequency.

    Args:
        dataset: with traces of object and water, a sampling rate and a centre frequency.
        picker: ``aic`` or ``threshold``: what finds the onset.
        progress: called with (emissions done, emissions in all).

    Returns:
        The dataset with ``delta_tof_s``, ``sigma_s`` and ``picker`` set, and without its traces and any
        older absolute travel times.

    Raises:
        InvalidInput: for an unknown picker, or a dataset that lacks one of the above.
    """
    if picker not in PICKERS:
        raise InvalidInput("picker", repr(picker), "one of " + ", ".join(PICKERS))
    if dataset.waveform is None:
        raise InvalidInput("waveform/object", "no traces", "traces to pick from")
    if dataset.waveform.water is None:
        raise InvalidInput("waveform/water", "no traces", "the same scan without the object, to compare with")
    if dataset.center_frequency_hz is None:
        raise InvalidInput(
            "acquisition@center_frequency_hz", "nothing", "the centre frequency of the pulse, Hz"
        )
    ntx, nz = len(dataset.tx), dataset.slices
    delta = np.empty((nz, ntx, len(dataset.rx)))
    likeness = np.empty_like(delta)
    for k in range(nz):
        one = dataset.slice(k)
        assert one.waveform is not None
        for e in range(ntx):
            _pick_emission(one, one.waveform, e, PICKERS[picker], delta[k, e], likeness[k, e])
            if progress is not None:
                progress(k * ntx + e + 1, nz * ntx)
        if one.valid is not None:
            delta[k][~one.valid] = np.nan
        delta[k][dataset.tx[:, None] == dataset.rx[None, :]] = np.nan
        delta[k] = consistent(one, delta[k], 0.5 / dataset.center_frequency_hz)
    sigma = _sigma(delta, likeness, dataset)
    if dataset.slice_z_m is None:
        delta, sigma = delta[0], sigma[0]
    return replace(dataset, delta_tof_s=delta, sigma_s=sigma, tof_s=None, picker=picker, waveform=None)


def _pick_emission(
    dataset: Dataset, traces: Waveform, e: int, picker: int, delta: Floats, likeness: Floats
) -> None:
    assert traces.water is not None
    assert dataset.sampling_rate_hz is not None
    assert dataset.center_frequency_hz is not None
    emitter = dataset.element_position_m[dataset.tx[e]]
    emission(
        np.ascontiguousarray(traces.object[e]),
        np.ascontiguousarray(traces.water[e]),
        np.linalg.norm(dataset.element_position_m[dataset.rx] - emitter, axis=1),
        float(dataset.water_speed_mps),
        float(dataset.sampling_rate_hz),
        float(dataset.t0_s),
        float(dataset.center_frequency_hz),
        ROUNDING if traces.object.dtype.kind == "i" else 0.0,
        picker,
        delta,
        likeness,
    )


def _sigma(delta: Floats, likeness: Floats, dataset: Dataset) -> Floats:
    """Standard deviation of the picks, s; NaN where there is none."""
    assert dataset.center_frequency_hz is not None
    assert dataset.sampling_rate_hz is not None
    same = np.where(np.isfinite(delta), np.minimum(likeness, 1.0), np.nan)
    spread = np.sqrt(1.0 - same**2) / (2.0 * np.pi * dataset.center_frequency_hz * same)
    return np.hypot(spread, FINEST / dataset.sampling_rate_hz)
