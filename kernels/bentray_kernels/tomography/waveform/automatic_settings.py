"""How waveforms refine what a reconstruction's settings ask for: bands, window and bounds from the scan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...acquisition import Dataset
from ...errors import InvalidInput
from ..settings import Settings
from .waveform_settings import Band, WaveSettings, bands, loss_band

# Parts of the time that a wave takes across the array, and periods of the pulse, before and after the arrival
# in water that traces are compared within: what is faster than water comes before, what is scattered after.
BEFORE, AFTER, PERIODS = 0.4, 0.25, 4.0

# Pairs nearer than this part of the array's width are left out: they hear what scatters from the skin.
NEAREST = 0.16


def wave_settings(dataset: Dataset, settings: Settings) -> WaveSettings:
    """How to refine a scan.

    Args:
        dataset: its traces may still lie in its file.
        settings: with ``method`` waveform.

    Raises:
        InvalidInput: for a scan in space or without a centre frequency.
    """
    if dataset.element_position_m.shape[1] != 2:
        raise InvalidInput(
            "method", "'waveform' for elements in space", "sart, gauss-newton or auto, or slices of a ring"
        )
    if settings.roi and dataset.slices > 1:
        raise InvalidInput("roi", "true", "false, with method waveform and several slices")
    if dataset.center_frequency_hz is None:
        raise InvalidInput(
            "acquisition@center_frequency_hz", "nothing", "the centre frequency of the pulse, Hz"
        )
    width = float(np.ptp(dataset.element_position_m, axis=0).max())
    across, pulse = width / dataset.water_speed_mps, PERIODS / dataset.center_frequency_hz
    return WaveSettings(
        plan_of(dataset.center_frequency_hz, dataset.water_speed_mps, settings),
        window_s=(BEFORE * across + pulse, AFTER * across + pulse),
        nearest_m=NEAREST * width,
        speed_bounds_mps=settings.speed_bounds_mps,
        seed=settings.seed,
        roi=settings.roi,
    )


def plan_of(centre_hz: float, water_mps: float, settings: Settings) -> tuple[Band, ...]:
    """The bands that are gone through; that of the attenuation comes last."""
    found = bands(centre_hz, water_mps)[: settings.wave_bands]
    if settings.attenuation:
        found = (*found, loss_band(centre_hz, water_mps))
    if settings.wave_emitters:
        found = tuple(replace(band, emitters=settings.wave_emitters) for band in found)
    return found


def check_traces(samples: int) -> None:
    """Hold against what a refinement needs.

    Args:
        samples: of each trace, of object and water; 0: there are none of one or both.

    Raises:
        InvalidInput: without traces of both.
    """
    if not samples:
        raise InvalidInput(
            "method",
            "'waveform' for a scan without traces of object and water",
            "sart, gauss-newton or auto, or waveform/object and waveform/water in the file",
        )
