"""Counts that the memory of a full-waveform refinement grows with, its tasks and its time.

The coefficients of these tasks are the bytes of their arrays, and not fitted: what dominates large
refinements (stored fields, resampler) is too small to be seen in those that can be measured in minutes.
"""

from __future__ import annotations

from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.solver_choice import wave_engine
from bentray_kernels.tomography.waveform.automatic_settings import WaveScale
from bentray_kernels.tomography.waveform.band_grid import Extent
from bentray_kernels.tomography.waveform.validation import validation_settings
from bentray_kernels.tomography.waveform.waveform_settings import Band, WaveSettings
from bentray_kernels.wave.device_memory import ShotSize
from bentray_kernels.wave.device_waves import PROCESSOR_EMITTERS

from ..cluster.task_costs import TaskSize
from ..files.dataset.counts import Traces

# Nodes of a field on a device over those of the padded image, at most: rows are filled up to groups.
FILLED = 1.5


def budgeted(traces: Traces | None, width_m: float, slices: int, settings: Settings) -> Settings:
    """The settings with the bands and emitters of a refinement within the time budget."""
    return settings if traces is None else _scale(traces, width_m, slices).budgeted(settings)


def refines(settings: Settings) -> bool:
    """Whether an image may be refined by waveforms; ``auto`` needs a time budget for it."""
    return settings.method == "waveform" or (settings.method == "auto" and bool(settings.minutes))


def wave_tasks(traces: Traces | None, width_m: float, settings: Settings) -> int:
    """Number of tasks of each slice, without shortened steps; 0 without a refinement."""
    if not refines(settings) or traces is None:
        return 0
    plan = _scale(traces, width_m).bands(settings)
    held_out = WaveSettings(plan).held_out
    return sum(band.evaluations(held_out) + band.iterations + 2 for band in plan)


def wave_minutes(traces: Traces | None, width_m: float, slices: int, settings: Settings) -> float:
    """Estimated CPU time of the refinement of all slices, minutes of one core; 0 without a refinement.

    Args:
        traces: of the dataset.
        width_m: of the array.
        slices: their number.
        settings: with the bands of the time budget, see ``budgeted``.
    """
    if not refines(settings) or traces is None:
        return 0.0
    return _scale(traces, width_m, slices).minutes(settings)


def wave_task_sizes(traces: Traces | None, width_m: float, settings: Settings) -> dict[str, TaskSize]:
    """Each task with the largest counts of all bands, and the validation of candidates, by name.

    They are in ``refinement_graph`` and ``validation``; none if no waves are simulated. The arguments are as
    of ``wave_minutes``.
    """
    if traces is None or not settings.selects_model:
        return {}
    plan = _scale(traces, width_m).bands(settings)
    (judge,) = validation_settings(WaveSettings(plan)).bands
    device = " on a device" if wave_engine(settings) == "opencl" else ""
    counts = {"validate_image": _counts(traces, width_m, settings, judge)}
    if refines(settings):
        bands = [_counts(traces, width_m, settings, band) for band in plan]
        largest = {name: max(band[name] for band in bands) for name in bands[0]}
        counts |= dict.fromkeys(("start_band", "evaluate_emitter", "update_image"), largest)
    sizes = {name: TaskSize(name + device, count) for name, count in counts.items()}
    if refines(settings):
        # A worker keeps what the tasks before have freed.
        names = ("start_band", "evaluate_emitter", "update_image")
        sizes |= dict.fromkeys(names, max((sizes[name] for name in names), key=lambda size: size.bytes))
    return sizes


def least_batch_bytes(traces: Traces | None, width_m: float, settings: Settings) -> int:
    """Device memory of one emitter over all bands, with checkpoints where these help; 0: none."""
    if traces is None or wave_engine(settings) != "opencl":
        return 0
    plan = _scale(traces, width_m).bands(settings)
    bands = plan if refines(settings) else validation_settings(WaveSettings(plan)).bands
    least = 0
    for band in bands:
        batch = _shot_size(traces, _extent(traces, width_m, settings, band))
        least = max(least, min(batch.bytes(segments) for segments in range(1, max(1, batch.slots) + 1)))
    return least


def _scale(traces: Traces, width_m: float, slices: int = 1) -> WaveScale:
    return WaveScale(traces.frequency_hz, traces.water_mps, width_m, _record_s(traces), slices)


def _record_s(traces: Traces) -> float:
    return (traces.samples - 1) / traces.rate_hz


def _extent(traces: Traces, width_m: float, settings: Settings, band: Band) -> Extent:
    return Extent.for_scan(band, 0.5 * width_m, _record_s(traces), settings.speed_bounds_mps[1])


def _shot_size(traces: Traces, extent: Extent) -> ShotSize:
    """An emitter on a device."""
    stored, samples = -(-extent.steps // extent.every), traces.receivers * extent.steps
    return ShotSize(int(FILLED * extent.padded), extent.nodes**2, stored, samples, 4)


def _counts(traces: Traces, width_m: float, settings: Settings, band: Band) -> dict[str, float]:
    extent = _extent(traces, width_m, settings, band)
    nodes, emitters = extent.nodes**2, band.emitters + WaveSettings((band,)).held_out
    on_device = 0
    if wave_engine(settings) == "opencl":
        # A processor as a device has its arrays in the memory of the worker; a GPU holds more emitters.
        on_device = PROCESSOR_EMITTERS * _shot_size(traces, extent).bytes(1)
    return {
        "nodes": nodes,
        "padded nodes": extent.padded,
        "samples of simulated traces": traces.receivers * extent.steps,
        "samples of all emitters": traces.receivers * extent.steps * emitters,
        "entries of the resampler": traces.samples * extent.steps,
        "bytes of recorded traces": traces.bytes_of(emitters),
        "bytes of a read": traces.read_bytes,
        "nodes of stored fields": nodes * -(-extent.steps // extent.every),
        "nodes of all gradients": nodes * emitters,
        "bytes on the device": on_device,
    }
