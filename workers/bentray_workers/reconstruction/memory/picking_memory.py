"""Memory of the tasks that examine and pick a scan, from the arrays of the kernels.

Compared with measured peaks in ``tests/workers/reconstruction/memory/test_picking_memory.py``. It does not
grow with the number of emissions times samples: a task reads one emission after the other.
"""

from __future__ import annotations

import math

from bentray_kernels.acquisition.picking.gate import FREQUENCIES
from bentray_kernels.acquisition.picking.pickers import PICKERS
from bentray_kernels.acquisition.picking.pulse import AFTER, BEFORE, EMISSIONS
from bentray_kernels.acquisition.reference.chord_pulses import chords_of_emission
from bentray_kernels.tomography.settings import Settings

from ...files.dataset.counts import Traces

# Samples of object and water in one task: half a second to a second.
TASK_SAMPLES = 10_000_000

# Overhead of tasks that read traces, with their libraries; that compute with times, or check them; that find
# chords through water; that write the result.
READING_BYTES, TIMES_BYTES, CHECKING_BYTES = 30 * 2**20, 6 * 2**20, 9 * 2**20
CHORDS_BYTES, WRITING_BYTES = 11 * 2**20, 12 * 2**20

# Bytes per sample of one emission: statistics; reading; filtering, padded to a power of two.
MEASURE_BYTES, READ_BYTES, FILTER_BYTES = 58, 12, 64

# Bytes for amplitudes of one emission: per sample of the gate, as long as the pulse; per frequency.
GATE_BYTES, POWER_BYTES = 24, 100

# Bytes per sample of an estimated water shot; per chord that it is estimated from: pulse, spectra.
SHOT_BYTES, PULSE_BYTES, SPECTRA_BYTES = 8, 2048, 10 * 1024

# Bytes per pair: copies of a period of its pulse and statistics; chords; checks of its time, measured from
# 128 to 1024 elements (10.5 to 119 MiB, planned 10.8 to 127); joining of 16 and 40 slices of 256 elements
# (52 and 122 MiB, planned 54 and 126).
PULSE_COPIES, FIGURE_BYTES, CHORD_BYTES, CHECK_BYTES, WRITE_BYTES = 3 * 8, 100, 210, 118, 48


def parts_of(emissions: int, trace_samples: int) -> list[range]:
    """Batches of emissions, one for each task.

    Args:
        emissions: of one slice.
        trace_samples: of all traces of one emission.
    """
    step = emissions_per_task(trace_samples)
    return [range(k, min(k + step, emissions)) for k in range(0, emissions, step)]


def emissions_per_task(trace_samples: int) -> int:
    """Largest number of emissions of one task."""
    return max(1, TASK_SAMPLES // max(trace_samples, 1))


def picking_tasks(traces: Traces | None, slices: int, settings: Settings) -> int:
    """Number of tasks that examine and pick a scan."""
    if traces is None:
        return 0
    parts = -(-traces.emissions // emissions_per_task(traces.receivers * traces.samples))
    examined = slices * (parts + 1) if settings.picking.examine or not traces.water_shot else 0
    examined += 0 if traces.water_shot else slices * (parts + 1)
    return examined + slices * (parts + 1) + 1


def picking_task_bytes(traces: Traces | None, pairs: int, settings: Settings) -> dict[str, int]:
    """Memory of each kind of task by its name in ``picking_graph``, bytes.

    Args:
        traces: of the scan; None without traces from which times can be picked.
        pairs: in all slices.
        settings: of the reconstruction.
    """
    sizes = {"write_picked": WRITING_BYTES + WRITE_BYTES * pairs}
    if traces is None:
        return sizes
    of_slice = traces.emissions * traces.receivers
    samples = traces.receivers * traces.samples
    reading = READING_BYTES + 2 * samples * traces.sample_bytes
    filtered = FILTER_BYTES if PICKERS[settings.picking.picker].filtered else 0
    sizes["pick_emissions"] = reading + (READ_BYTES + filtered) * samples + 8 * of_slice
    if settings.reads_amplitudes:
        pulse = math.ceil((BEFORE + AFTER) * traces.rate_hz / traces.frequency_hz) + 1
        # The pulse is the median over several emissions.
        sizes["pick_emissions"] += traces.receivers * pulse * (GATE_BYTES + PULSE_COPIES * EMISSIONS)
        sizes["pick_emissions"] += traces.receivers * FREQUENCIES * POWER_BYTES + 8 * of_slice
    if not traces.water_shot:
        chords = traces.emissions * chords_of_emission(traces.emissions)
        # One of two shots is read, the other computed.
        sizes["pick_emissions"] += SHOT_BYTES * samples - 2 * READING_BYTES // 5
        sizes["find_chords"] = CHORDS_BYTES + CHORD_BYTES * of_slice
        sizes["read_chords"] = reading + READ_BYTES * samples + PULSE_BYTES * chords
        sizes["estimate_slice_water"] = TIMES_BYTES + SPECTRA_BYTES * chords
    if settings.picking.examine or not traces.water_shot:
        sizes["measure_traces"] = reading + MEASURE_BYTES * samples
    sizes["finish_slice"] = CHECKING_BYTES + finish_slice_bytes(of_slice)
    if settings.picking.examine:
        pulse = PULSE_COPIES * (2 * math.ceil(traces.rate_hz / traces.frequency_hz) + 1)
        sizes["examine_slice"] = reading + READ_BYTES * samples + (pulse + FIGURE_BYTES) * of_slice
        if not traces.water_shot:
            # It reads no traces: polarity is checked in the water shot.
            sizes["examine_slice"] = 2 * TIMES_BYTES + FIGURE_BYTES * of_slice
    return sizes


def finish_slice_bytes(pairs: int) -> int:
    """Memory of the task that finishes one slice with times."""
    return CHECKING_BYTES + CHECK_BYTES * pairs


def join_slices_bytes(pairs: int) -> int:
    """Memory of the task that joins slices with times, which stay on the workers until then."""
    return TIMES_BYTES + WRITE_BYTES * pairs
