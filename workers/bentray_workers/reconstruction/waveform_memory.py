"""Memory of the tasks of a full-waveform refinement, from the arrays of the kernels.

Formulas, and no fitted coefficients as of other tasks: the stored fields grow with the fourth power of the
frequency. Sizes that can be measured in seconds take at most 30 MiB, of which resampled traces are most, so
that a fit to them says nothing of the fields (it gave them no bytes). ``bentray bench task_memory`` judges
them.
"""

from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.solver_choice import wave_engine
from bentray_kernels.tomography.waveform.automatic_settings import WaveScale
from bentray_kernels.tomography.waveform.band_grid import Extent
from bentray_kernels.tomography.waveform.lbfgs import MEMORY
from bentray_kernels.tomography.waveform.source_calibration import SHOTS
from bentray_kernels.tomography.waveform.validation import validation_settings
from bentray_kernels.tomography.waveform.waveform_settings import Band, WaveSettings
from bentray_kernels.wave.device_memory import ShotSize
from bentray_kernels.wave.device_waves import PROCESSOR_EMITTERS

from ..files.dataset.counts import Traces

# Overhead of Python in any task.
FLOOR_BYTES = 13 * 2**20 // 2

# Of a band's grid, windows and spectra, which are small beside the arrays.
START_BYTES = 2**20

# Of the waves through an image that are compared, as at the start of a band with two rims.
VALIDATION_BYTES = 2 * 2**20

# Bytes per sample: simulated and recorded water shots, spectra and windows; traces, window and residuals of
# one emitter; entries of the resampler while it is made.
SHOT_BYTES, LOOK_BYTES, SAMPLER_BYTES = 144, 96, 64

# Bytes per sample of the recorded traces that are kept for devices, with their weights; per node of the
# images that an emitter brings back from one.
OBSERVED_BYTES, FOUND_BYTES = 8, 12

# Nodes of a field on a device over those of the padded image, at most: rows are filled up to groups.
FILLED = 1.5

# Bytes per node: medium and fields; images of an update, without L-BFGS pairs.
MEDIUM_BYTES, STEP_BYTES = 72, 280


def budgeted(traces: Traces | None, width_m: float, slices: int, settings: Settings) -> Settings:
    """The settings with the bands and emitters of a refinement within the time budget."""
    return settings if traces is None else _scale(traces, width_m, slices).budgeted(settings)


def _scale(traces: Traces, width_m: float, slices: int = 1) -> WaveScale:
    record_s = (traces.samples - 1) / traces.rate_hz
    return WaveScale(traces.frequency_hz, traces.water_mps, width_m, record_s, slices)


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


def wave_task_bytes(traces: Traces | None, width_m: float, settings: Settings) -> dict[str, int]:
    """Memory of each kind of task over all bands, and of the validation of candidates, bytes.

    Args:
        traces: of the dataset.
        width_m: of the array.
        settings: with the bands of the time budget, see ``budgeted``.

    Returns:
        By the name of the task in ``refinement_graph`` and ``validation``; empty if no waves are simulated.
    """
    if traces is None or not settings.selects_model:
        return {}
    plan = _scale(traces, width_m).bands(settings)
    (judge,) = validation_settings(WaveSettings(plan)).bands
    sizes = {"validate_image": _band_bytes(traces, width_m, settings, judge)["start_band"]}
    for band in plan if refines(settings) else ():
        for name, size in _band_bytes(traces, width_m, settings, band).items():
            sizes[name] = max(size, sizes.get(name, 0))
    return sizes


def least_batch_bytes(traces: Traces | None, width_m: float, settings: Settings) -> int:
    """Device memory of one emitter over all bands, with checkpoints where these help; 0: none."""
    if traces is None or wave_engine(settings) != "opencl":
        return 0
    plan = _scale(traces, width_m).bands(settings)
    bands = plan if refines(settings) else validation_settings(WaveSettings(plan)).bands
    record_s = (traces.samples - 1) / traces.rate_hz
    least = 0
    for band in bands:
        extent = Extent.for_scan(band, 0.5 * width_m, record_s, settings.speed_bounds_mps[1])
        batch = _shot_size(traces, extent)
        least = max(least, min(batch.bytes(segments) for segments in range(1, max(1, batch.slots) + 1)))
    return least


def _shot_size(traces: Traces, extent: Extent) -> ShotSize:
    """An emitter on a device."""
    stored, samples = -(-extent.steps // extent.every), traces.receivers * extent.steps
    return ShotSize(int(FILLED * extent.padded), extent.nodes**2, stored, samples, 4)


def _band_bytes(traces: Traces, width_m: float, settings: Settings, band: Band) -> dict[str, int]:
    record_s = (traces.samples - 1) / traces.rate_hz
    extent = Extent.for_scan(band, 0.5 * width_m, record_s, settings.speed_bounds_mps[1])
    image, padded = 8 * extent.nodes**2, extent.padded
    samples = traces.receivers * extent.steps
    looks = band.emitters + WaveSettings((band,)).held_out
    # Cached data of a problem: traces of its emitters, and the resampler to the time steps of the simulation.
    cached = traces.bytes_of(looks) + 4 * traces.samples * extent.steps
    base = FLOOR_BYTES + cached
    medium = MEDIUM_BYTES * padded
    stored = -(-extent.steps // extent.every)
    in_flight = 4 * extent.nodes**2 * stored
    if wave_engine(settings) == "opencl":
        base += OBSERVED_BYTES * samples * looks
        batch = _shot_size(traces, extent).bytes(1)
        # A processor as a device has its arrays in the memory of the worker; a GPU holds more emitters.
        in_flight = (
            PROCESSOR_EMITTERS * batch + (OBSERVED_BYTES * samples + FOUND_BYTES * extent.nodes**2) * looks
        )
    return {
        "start_band": base
        + START_BYTES
        + VALIDATION_BYTES
        + 2 * traces.read_bytes
        + max(SAMPLER_BYTES * traces.samples * extent.steps, SHOTS * SHOT_BYTES * samples)
        + medium
        # With the L-BFGS pairs of the band before, on its grid and on this one.
        + (12 + 4 * MEMORY) * image,
        "evaluate_emitter": base + in_flight + LOOK_BYTES * samples + medium + 4 * image,
        # The results of all emitters, and the L-BFGS pairs before and after.
        # Threads of compiled code keep the memory of the stored fields, see ``adjoint``.
        "update_image": base
        + (in_flight if wave_engine(settings) == "compiled" else 0)
        + 2 * image * looks
        + 4 * MEMORY * image
        + STEP_BYTES * extent.nodes**2,
    }
