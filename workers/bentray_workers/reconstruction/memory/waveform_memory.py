"""Bytes that the calls of a refinement by waveforms take, counted from the arrays that the kernels make.

``tests/workers/reconstruction/memory/test_waveform_memory.py`` holds them against measured peaks.
"""

from __future__ import annotations

from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.waveform.automatic_settings import (
    WaveScale,
    check_traces,
)
from bentray_kernels.tomography.waveform.band_grid import Extent
from bentray_kernels.tomography.waveform.source_calibration import SHOTS
from bentray_kernels.tomography.waveform.validation import judging
from bentray_kernels.tomography.waveform.waveform_settings import Band, WaveSettings

from ...files.dataset.counts import Traces

# Python's own part of any call.
FLOOR_BYTES = 11 * 2**20 // 2

# Bytes a sample: of the simulated water shots with recorded ones, spectra and windows; of one emitter's
# traces, window and residuals; of an entry of the resampler while it is made.
SHOT_BYTES, LOOK_BYTES, SAMPLER_BYTES = 140, 96, 64

# Bytes a node: of what a medium is made of and its fields; of an image in a step, beside pairs of changes.
MEDIUM_BYTES, STEP_BYTES = 72, 280


def budgeted(traces: Traces | None, width_m: float, slices: int, settings: Settings) -> Settings:
    """The settings with the bands and emitters of a refinement within the time budget."""
    return settings if traces is None else _scale(traces, width_m, slices).budgeted(settings)


def _scale(traces: Traces, width_m: float, slices: int = 1) -> WaveScale:
    record_s = (traces.samples - 1) / traces.rate_hz
    return WaveScale(traces.frequency_hz, traces.water_mps, width_m, record_s, slices)


def refines(settings: Settings) -> bool:
    """Whether an image may be refined by waves; ``auto`` does so where it is given the minutes."""
    return settings.method == "waveform" or (settings.method == "auto" and bool(settings.minutes))


def wave_tasks(traces: Traces | None, width_m: float, settings: Settings) -> int:
    """Calls of each slice: looks of single emitters and steps, unless some are shortened; 0 without waves."""
    if not refines(settings) or traces is None:
        return 0
    plan = _scale(traces, width_m).bands(settings)
    held_out = WaveSettings(plan).held_out
    return sum(band.looks(held_out) + band.iterations + 2 for band in plan)


def wave_call_bytes(traces: Traces | None, width_m: float, settings: Settings) -> dict[str, int]:
    """Bytes of each kind of call, over all bands, and of the call by which trials are judged.

    Args:
        traces: of the dataset.
        width_m: of the array.
        settings: with the bands of the time budget, see ``budgeted``.

    Returns:
        By the call's name in ``waveform_chain`` and ``validation``; nothing where no waves are simulated.

    Raises:
        InvalidInput: for a refinement without traces.
    """
    if settings.method == "waveform":
        check_traces(0 if traces is None else traces.samples)
    if traces is None or not settings.selects_model:
        return {}
    plan = _scale(traces, width_m).bands(settings)
    (judge,) = judging(WaveSettings(plan)).bands
    found = {"judge_by_waves": _band_bytes(traces, width_m, settings, judge)["enter"]}
    for band in plan if refines(settings) else ():
        for name, size in _band_bytes(traces, width_m, settings, band).items():
            found[name] = max(size, found.get(name, 0))
    return found


def _band_bytes(traces: Traces, width_m: float, settings: Settings, band: Band) -> dict[str, int]:
    record_s = (traces.samples - 1) / traces.rate_hz
    extent = Extent.of(band, 0.5 * width_m, record_s, settings.speed_bounds_mps[1])
    image, padded = 8 * extent.nodes**2, extent.padded**2
    samples = traces.receivers * extent.steps
    looks = band.emitters + WaveSettings((band,)).held_out
    # What a process keeps of a problem: traces of its emitters, what takes them to the simulator's time.
    kept = traces.bytes_of(looks) + 4 * traces.samples * extent.steps
    base = FLOOR_BYTES + kept
    medium = MEDIUM_BYTES * padded
    return {
        "enter": base
        + 2 * traces.read_bytes
        + max(SAMPLER_BYTES * traces.samples * extent.steps, SHOTS * SHOT_BYTES * samples)
        + medium
        + 12 * image,
        "look_at_waves": base
        + 4 * extent.nodes**2 * -(-extent.steps // extent.every)
        + LOOK_BYTES * samples
        + medium
        + 4 * image,
        # The looks of all emitters, and the pairs of changes before and after.
        "step_by_waves": base
        + 2 * image * looks
        + 4 * WaveSettings((band,)).memory * image
        + STEP_BYTES * extent.nodes**2,
    }
