"""Automatic settings of a full-waveform refinement: bands, window and bounds from the scan."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...acquisition import Dataset
from ...errors import InvalidInput
from ..numerics import BANDS
from ..requirements import check_waveform
from ..settings import Settings
from ..solver_choice import wave_engine
from .half_runs import half_plans
from .waveform_cost import core_seconds
from .waveform_settings import Band, WaveSettings, bands, loss_band

# The window in which traces are compared, before and after the arrival in water: parts of the travel time
# across the array, plus periods of the pulse. Waves faster than water come earlier, scattered ones later.
BEFORE, AFTER, PERIODS = 0.4, 0.25, 4.0

# Pairs nearer than this part of the array's width are left out: scattering from the skin dominates them.
NEAREST = 0.16

# The time budget does not reduce the emitters of a band below this number.
MIN_EMITTERS = 8


class WaveScale(NamedTuple):
    """Properties of a scan that determine the cost of its refinement.

    Attributes:
        centre_hz: centre frequency of the pulse, Hz.
        water_mps: speed of the water, m/s.
        width_m: of the array, m.
        record_s: duration of a trace, s.
        slices: their number.
    """

    centre_hz: float
    water_mps: float
    width_m: float
    record_s: float
    slices: int

    def minutes(self, settings: Settings) -> float:
        """Estimated CPU time of the refinement, minutes of one core."""
        return self._minutes(settings, settings.numerics.bands, settings.numerics.emitters)

    def bands(self, settings: Settings) -> tuple[Band, ...]:
        """The bands of the refinement, that of the attenuation last."""
        return self._bands(settings, settings.numerics.bands, settings.numerics.emitters)

    def _bands(self, settings: Settings, count: int | None, emitters: int | None) -> tuple[Band, ...]:
        """The first ``count`` bands of the speed, all for None; ``emitters`` None: the usual number."""
        plan = bands(self.centre_hz, self.water_mps)[:count]
        if settings.attenuation.enabled:
            plan = (*plan, loss_band(self.centre_hz, self.water_mps))
        return plan if emitters is None else tuple(replace(band, emitters=emitters) for band in plan)

    def _minutes(self, settings: Settings, count: int | None, emitters: int | None) -> float:
        plan = self._bands(settings, count, emitters)
        if settings.uncertainty:
            plan = (*plan, *(band for half in half_plans(WaveSettings(plan)) for band in half.bands))
        fastest = settings.speed_bounds_mps[1]
        return self.slices * core_seconds(plan, self.width_m, self.record_s, fastest) / 60.0

    def budgeted(self, settings: Settings) -> Settings:
        """The settings with the bands and emitters that the time budget allows.

        As many bands as possible, at least one; if a single band takes too long, fewer emitters, at least
        ``MIN_EMITTERS``. Fixed bands and emitters are not changed; without a budget all bands are used.
        """
        most, emitters = settings.minutes, settings.numerics.emitters
        if most is None or settings.numerics.bands is not None:
            return settings
        count = BANDS
        while count > 1 and self._minutes(settings, count, emitters) > most:
            count -= 1
        if emitters is None and self._minutes(settings, count, None) > most:
            emitters = min(band.emitters for band in bands(self.centre_hz, self.water_mps))
            while emitters > MIN_EMITTERS and self._minutes(settings, count, emitters) > most:
                emitters //= 2
        return settings.changed(bands=count, emitters=emitters)


def scale_of(dataset: Dataset, settings: Settings, samples: int, slices: int) -> WaveScale:
    """The scale of a scan; checks that it can be refined.

    Args:
        dataset: its traces may still be in its file.
        settings: as requested.
        samples: of each trace of object and water; 0 if one or both are missing.
        slices: their number.

    Raises:
        InvalidInput: for a scan without traces of object and water, without a centre frequency, or with
            elements in space.
    """
    check_waveform(settings, samples, dataset.slices, in_space=dataset.element_position_m.shape[1] != 2)
    if dataset.center_frequency_hz is None:
        raise InvalidInput(
            "acquisition@center_frequency_hz", "nothing", "the centre frequency of the pulse, Hz"
        )
    width = float(np.ptp(dataset.element_position_m, axis=0).max())
    record_s = (samples - 1) / dataset.rate_hz
    return WaveScale(dataset.center_frequency_hz, dataset.water_speed_mps, width, record_s, slices)


def wave_settings(scale: WaveScale, settings: Settings) -> WaveSettings:
    """The settings of the refinement of a scan."""
    across, pulse = scale.width_m / scale.water_mps, PERIODS / scale.centre_hz
    return WaveSettings(
        scale.bands(settings),
        window_s=(BEFORE * across + pulse, AFTER * across + pulse),
        nearest_m=NEAREST * scale.width_m,
        speed_bounds_mps=settings.speed_bounds_mps,
        seed=settings.numerics.seed,
        roi=settings.roi,
        opening_angle_deg=settings.opening_angle_deg,
        engine=wave_engine(settings),
    )
