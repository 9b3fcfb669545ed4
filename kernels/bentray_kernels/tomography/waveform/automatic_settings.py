"""How waveforms refine what a reconstruction's settings ask for: bands, window and bounds from the scan."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...acquisition import Dataset
from ...errors import InvalidInput
from ..numerics import BANDS
from ..settings import Settings
from .waveform_cost import core_seconds
from .waveform_settings import Band, WaveSettings, bands, loss_band

# Parts of the time that a wave takes across the array, and periods of the pulse, before and after the arrival
# in water that traces are compared within: what is faster than water comes before, what is scattered after.
BEFORE, AFTER, PERIODS = 0.4, 0.25, 4.0

# Pairs nearer than this part of the array's width are left out: they hear what scatters from the skin.
NEAREST = 0.16


# No band has fewer emitters for the sake of the time budget.
LEAST_EMITTERS = 8


class WaveScale(NamedTuple):
    """What the cost of a refinement depends on.

    Attributes:
        centre_hz: centre frequency of the pulse, Hz.
        water_mps: speed of the water, m/s.
        width_m: of the array, m.
        record_s: from the first sample of a trace to the last, s.
        slices: how many.
    """

    centre_hz: float
    water_mps: float
    width_m: float
    record_s: float
    slices: int

    def minutes(self, settings: Settings) -> float:
        """About how long one core works on the refinement."""
        return self._minutes(settings, settings.numerics.bands, settings.numerics.emitters)

    def bands(self, settings: Settings) -> tuple[Band, ...]:
        """The bands that the settings have fixed, or all."""
        fixed = settings.numerics
        return bands_of(self.centre_hz, self.water_mps, settings, fixed.bands, fixed.emitters)

    def _minutes(self, settings: Settings, count: int | None, emitters: int | None) -> float:
        plan = bands_of(self.centre_hz, self.water_mps, settings, count, emitters)
        fastest = settings.speed_bounds_mps[1]
        return self.slices * core_seconds(plan, self.width_m, self.record_s, fastest) / 60.0

    def budgeted(self, settings: Settings) -> Settings:
        """The settings with the bands and emitters that the time budget allows.

        As many bands as it allows, at least one, and if one takes too long fewer emitters, at least
        ``LEAST_EMITTERS``. Bands and emitters that are fixed stay; without a budget all bands are used.
        """
        most, emitters = settings.minutes, settings.numerics.emitters
        if most is None or settings.numerics.bands is not None:
            return settings
        count = BANDS
        while count > 1 and self._minutes(settings, count, emitters) > most:
            count -= 1
        if emitters is None and self._minutes(settings, count, None) > most:
            emitters = min(band.emitters for band in bands(self.centre_hz, self.water_mps))
            while emitters > LEAST_EMITTERS and self._minutes(settings, count, emitters) > most:
                emitters //= 2
        return settings.changed(bands=count, emitters=emitters)


def scale_of(dataset: Dataset, settings: Settings, samples: int, slices: int) -> WaveScale:
    """The cost factors of a scan that can be refined.

    Args:
        dataset: its traces may still lie in its file.
        settings: as requested.
        samples: of each trace of object and water; 0: there are none of one or both.
        slices: how many.

    Raises:
        InvalidInput: for a scan without traces or a centre frequency, or in space.
    """
    check_traces(samples)
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
    assert dataset.sampling_rate_hz is not None
    width = float(np.ptp(dataset.element_position_m, axis=0).max())
    record_s = (samples - 1) / dataset.sampling_rate_hz
    return WaveScale(dataset.center_frequency_hz, dataset.water_speed_mps, width, record_s, slices)


def wave_settings(scale: WaveScale, settings: Settings) -> WaveSettings:
    """How to refine a scan."""
    across, pulse = scale.width_m / scale.water_mps, PERIODS / scale.centre_hz
    return WaveSettings(
        scale.bands(settings),
        window_s=(BEFORE * across + pulse, AFTER * across + pulse),
        nearest_m=NEAREST * scale.width_m,
        speed_bounds_mps=settings.speed_bounds_mps,
        seed=settings.seed,
        roi=settings.roi,
    )


def bands_of(
    centre_hz: float, water_mps: float, settings: Settings, count: int | None, emitters: int | None
) -> tuple[Band, ...]:
    """The bands of a refinement; that of the attenuation comes last.

    Args:
        centre_hz: of the pulse, Hz.
        water_mps: speed of the water, m/s.
        settings: whether the attenuation is refined.
        count: of the speed's bands, from the lowest frequency; None: all.
        emitters: of each band; None: as many as is usual.
    """
    found = bands(centre_hz, water_mps)[:count]
    if settings.attenuation.enabled:
        found = (*found, loss_band(centre_hz, water_mps))
    return found if emitters is None else tuple(replace(band, emitters=emitters) for band in found)


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
