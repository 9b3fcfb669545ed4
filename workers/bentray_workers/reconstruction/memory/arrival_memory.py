"""Bytes that the calls take which examine and pick a scan, counted from the arrays that the kernels make.

``tests/workers/reconstruction/memory/test_arrival_memory.py`` holds them against measured peaks. None of
them grows with the number of emissions times samples: a call reads one emission after the other.
"""

from __future__ import annotations

import math

from bentray_kernels.acquisition.picking.gate import FREQUENCIES
from bentray_kernels.acquisition.picking.pickers import PICKERS
from bentray_kernels.acquisition.picking.pulse import AFTER, BEFORE, EMISSIONS
from bentray_kernels.tomography.settings import Settings

from ...files.dataset.counts import Traces

# Samples of object and water that are worked on in one call: half a second to a second.
CALL_SAMPLES = 10_000_000

# Of any call that reads traces, with the libraries that it wakes; of one that looks at times; of the last.
READING_BYTES, TIMES_BYTES, JOINING_BYTES = 30 * 2**20, 6 * 2**20, 11 * 2**20

# Bytes a sample of one emission: of its figures; while it is read; filtered, padded to a power of two.
MEASURE_BYTES, READ_BYTES, FILTER_BYTES = 58, 12, 64

# Bytes of the amplitudes of one emission: a sample of the gate, as long as the measured pulse; a frequency.
GATE_BYTES, POWER_BYTES = 24, 100

# Bytes a pair: of copies of a period of its pulse beside its figures; of its neighbours and their medians.
PULSE_COPIES, FIGURE_BYTES, SETTLE_BYTES = 3 * 8, 100, 720


def parts_of(emissions: int, trace_samples: int) -> list[range]:
    """The emissions of each call.

    Args:
        emissions: of one slice.
        trace_samples: of all traces of one emission.
    """
    step = emissions_a_call(trace_samples)
    return [range(k, min(k + step, emissions)) for k in range(0, emissions, step)]


def emissions_a_call(trace_samples: int) -> int:
    """Of how many emissions a call reads the traces, at most."""
    return max(1, CALL_SAMPLES // max(trace_samples, 1))


def arrival_tasks(traces: Traces | None, slices: int, settings: Settings) -> int:
    """Calls of a scan whose times are read; see ``arrivals``."""
    if traces is None:
        return 0
    parts = -(-traces.emissions // emissions_a_call(traces.receivers * traces.samples))
    examined = slices * (parts + 1) if settings.picking.examine else 0
    return examined + (slices * (parts + 1) + 1) * (1 + settings.numerics.guided_rounds)


def arrival_call_bytes(traces: Traces | None, pairs: int, settings: Settings) -> dict[str, int]:
    """Bytes of each kind of call, by its name in ``arrivals``.

    Args:
        traces: of the scan; None where they are not there, or do not have what is needed to read times.
        pairs: in all slices.
        settings: of the reconstruction.
    """
    found = {"join": JOINING_BYTES + 48 * pairs}
    if traces is None:
        return found
    of_slice = traces.emissions * traces.receivers
    samples = traces.receivers * traces.samples
    reading = READING_BYTES + 2 * samples * traces.sample_bytes
    filtered = FILTER_BYTES if PICKERS[settings.picking.picker].filtered else 0
    found["read"] = reading + (READ_BYTES + filtered) * samples + 8 * of_slice
    if settings.reads_amplitudes:
        pulse = math.ceil((BEFORE + AFTER) * traces.rate_hz / traces.frequency_hz) + 1
        # The pulse is the median of those of several emissions.
        found["read"] += traces.receivers * pulse * (GATE_BYTES + PULSE_COPIES * EMISSIONS)
        found["read"] += traces.receivers * FREQUENCIES * POWER_BYTES + 8 * of_slice
    found["settle"] = settle_bytes(of_slice)
    if settings.picking.examine:
        pulse = PULSE_COPIES * (2 * math.ceil(traces.rate_hz / traces.frequency_hz) + 1)
        found["measure"] = reading + MEASURE_BYTES * samples
        found["judge"] = reading + READ_BYTES * samples + (pulse + FIGURE_BYTES) * of_slice
    return found


def settle_bytes(pairs: int) -> int:
    """Of the call that looks at the times of one slice."""
    return TIMES_BYTES + SETTLE_BYTES * pairs
