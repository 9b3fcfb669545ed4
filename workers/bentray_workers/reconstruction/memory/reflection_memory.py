"""Memory and CPU time of the tasks of a reflection image, from the arrays of the kernels.

Compared with measured peaks in ``tests/workers/reconstruction/memory/test_reflection_memory.py``.
"""

from __future__ import annotations

import math

from bentray_kernels.tomography.reflection.delay_and_sum import TILE
from bentray_kernels.tomography.reflection.delay_and_sum_opencl import PIXELS, SUM_BYTES, VIEW_BYTES
from bentray_kernels.tomography.reflection.echoes import upsampling
from bentray_kernels.tomography.reflection.reflection_graph import ELEMENTS, PULSE_EMISSIONS
from bentray_kernels.tomography.reflection.reflection_plan import emissions_per_task, pixel_size, side_pixels
from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.solver_choice import echo_engine

from ...cluster.capacities import MIB, REAL
from ...files.dataset.counts import Summary, Traces
from .ray_memory import field_bytes

# Overhead of Python in any task.
FLOOR_BYTES = 7 * MIB // 2

# Bytes per pixel of the sums, and of their copy for another process.
SUMS_BYTES = 2 * 16

# Bytes per sample of an upsampled signal while one emission is transformed: a complex spectrum, the complex
# signal, its copy; and per recorded sample: traces and window in double precision, and of a water shot its
# traces, their spectrum and delays, and products of both.
TRANSFORM_BYTES, TRACE_BYTES, WATER_BYTES = 24, 48, 56

# Pairs of a core in a second, at one pixel.
PAIRS_PER_S = 2.5e8


def pixels_of(traces: Traces, width_m: float, settings: Settings) -> int:
    """Pixels along a side of the image."""
    wavelength = traces.water_mps / traces.frequency_hz
    return side_pixels(width_m, pixel_size(settings.numerics.pixel_m, width_m, wavelength))


def reflection_task_bytes(scan: Summary, settings: Settings) -> dict[str, int]:
    """Memory of each kind of task, bytes; empty without a reflection image.

    Args:
        scan: the dataset.
        settings: with nodes.
    """
    traces = scan.echoes
    if traces is None or not settings.reflection.enabled:
        return {}
    nodes, elements = settings.grid_nodes, scan.emitters
    field = 4 * (nodes + 3) ** 2
    side = pixels_of(traces, scan.width_m, settings)
    factor = upsampling(traces.rate_hz, traces.frequency_hz)
    signals = traces.receivers * traces.samples * factor
    batch = min(emissions_per_task(traces.receivers, traces.samples * factor), traces.emissions)
    views = 16 * (batch + traces.receivers) * TILE**2
    # As sent, joined, and a selection of them.
    times = 3 * elements * field
    image = 2 * REAL * nodes**2 + side**2
    reading = 2 * traces.read_bytes + traces.receivers * traces.samples * TRACE_BYTES
    # Blocks of its file stay in memory beside those of the object.
    water = 2 * traces.read_bytes + traces.receivers * traces.samples * WATER_BYTES
    there = 0
    if echo_engine(settings) == "opencl":
        # A processor as a device has its buffers in the memory of the worker.
        there = 8 * batch * signals + elements * field
        there += (VIEW_BYTES * elements + SUM_BYTES * batch) * min(PIXELS, side**2)
    return {
        "solve_element_times": FLOOR_BYTES
        + field_bytes((nodes, nodes), "accurate")
        + 4 * REAL * nodes**2
        + ELEMENTS * field,
        "measure_scan_pulse": FLOOR_BYTES
        + times
        + image
        + reading
        + min(PULSE_EMISSIONS, traces.emissions) * traces.bytes_of(1)
        + TRANSFORM_BYTES * traces.receivers * traces.samples,
        "sum_emissions": FLOOR_BYTES
        + times
        + image
        + SUMS_BYTES * side**2
        + reading
        + (water if traces.water_shot else 0)
        + 8 * batch * signals
        + TRANSFORM_BYTES * signals
        + views
        + there,
    }


def reflection_tasks(scan: Summary, settings: Settings) -> int:
    """Number of tasks of all slices; 0 without a reflection image."""
    traces = scan.echoes
    if traces is None or not settings.reflection.enabled:
        return 0
    samples = traces.samples * upsampling(traces.rate_hz, traces.frequency_hz)
    sums = math.ceil(traces.emissions / emissions_per_task(traces.receivers, samples))
    return scan.slices * (math.ceil(scan.emitters / ELEMENTS) + 1 + sums)


def reflection_bytes(scan: Summary, settings: Settings) -> int:
    """Size of the image of one slice in the result, and of its checkpoints, without compression."""
    traces = scan.echoes
    if traces is None or not settings.reflection.enabled:
        return 0
    return (REAL + 2 * 16) * pixels_of(traces, scan.width_m, settings) ** 2


def reflection_seconds(scan: Summary, settings: Settings) -> float:
    """CPU time of all slices on a core of 2020, s; 0 without a reflection image."""
    traces = scan.echoes
    if traces is None or not settings.reflection.enabled:
        return 0.0
    side = pixels_of(traces, scan.width_m, settings)
    return scan.slices * traces.emissions * traces.receivers * side**2 / PAIRS_PER_S
