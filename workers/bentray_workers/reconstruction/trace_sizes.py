"""What determines the memory of the tasks that use traces: picking, and the reflection image.

None grows with the number of emissions times samples: a task reads one emission after the other.
"""

import math

from bentray_kernels.acquisition.picking.pickers import PICKERS
from bentray_kernels.acquisition.picking.pulse import AFTER, BEFORE
from bentray_kernels.acquisition.reference.chord_pulses import chords_of_emission
from bentray_kernels.tomography.reflection.delay_and_sum_opencl import PIXELS
from bentray_kernels.tomography.reflection.echoes import upsampling
from bentray_kernels.tomography.reflection.reflection_graph import ELEMENTS
from bentray_kernels.tomography.reflection.reflection_plan import emissions_per_task, pixel_size, side_pixels
from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.solver_choice import echo_engine

from ..cluster.capacities import REAL
from ..cluster.task_costs import Sizes, TaskSize
from ..files.dataset.counts import BLOCK_BYTES, Summary, Traces

# Samples of object and water in one task: half a second to a second.
TASK_SAMPLES = 10_000_000

# Pairs of a core in a second, at one pixel.
PAIRS_PER_S = 2.5e8


def parts_of(emissions: int, trace_samples: int) -> list[range]:
    """Batches of emissions, one for each task.

    Args:
        emissions: of one slice.
        trace_samples: of all traces of one emission.
    """
    step = _emissions_a_task(trace_samples)
    return [range(k, min(k + step, emissions)) for k in range(0, emissions, step)]


def _emissions_a_task(trace_samples: int) -> int:
    return max(1, TASK_SAMPLES // max(trace_samples, 1))


def picking_tasks(traces: Traces | None, slices: int, settings: Settings) -> int:
    """Number of tasks that examine and pick a scan."""
    if traces is None:
        return 0
    parts = -(-traces.emissions // _emissions_a_task(traces.receivers * traces.samples))
    examined = slices * (parts + 1) if settings.picking.examine or not traces.water_shot else 0
    examined += 0 if traces.water_shot else slices * (parts + 1)
    return examined + slices * (parts + 1) + 1


def picking_task_sizes(scan: Summary, settings: Settings) -> Sizes:
    """Sizes of the tasks of ``picking_graph``, by name."""
    joined = scan.pairs if scan.slices > 1 else 0
    written = {"write_picked": TaskSize("write_picked", {"pairs": scan.pairs, "joined pairs": joined})}
    finished = {"finish_slice": TaskSize("finish_slice", {"pairs": scan.pairs // scan.slices})}
    if not scan.traces_bytes:
        return {**finished, **written} if settings.picking.examine else {}
    traces = scan.recorded
    if traces is None:
        return written
    pairs, samples = traces.emissions * traces.receivers, traces.receivers * traces.samples
    read = {"read traces": read_bytes(traces), "samples": samples}
    filtered = samples if PICKERS[settings.picking.picker].filtered else 0
    picked = {**read, "filtered samples": filtered, "pairs": pairs}
    if settings.reads_amplitudes:
        pulse = math.ceil((BEFORE + AFTER) * traces.rate_hz / traces.frequency_hz) + 1
        picked["pulses"] = traces.receivers * pulse
    sizes = {"pick_emissions": TaskSize("pick_emissions", picked), **finished, **written}
    if not traces.water_shot:
        chords = {"chords": traces.emissions * chords_of_emission(traces.emissions)}
        sizes["find_chords"] = TaskSize("find_chords", {"pairs": pairs})
        sizes["read_chords"] = TaskSize("read_chords", {**read, **chords})
        sizes["estimate_slice_water"] = TaskSize("estimate_slice_water", {"pairs": pairs})
    if settings.picking.examine or not traces.water_shot:
        sizes["measure_traces"] = TaskSize("measure_traces", read)
    if settings.picking.examine:
        # Without a water shot it reads no traces: polarity is checked in the estimated shot.
        counts = {"pairs": pairs, **(read if traces.water_shot else {})}
        sizes["examine_slice"] = TaskSize("examine_slice", counts)
    return sizes


def read_bytes(traces: Traces) -> int:
    """Traces that a task holds while it reads one emission after the other: one, or a block of them."""
    shots = 1 + traces.water_shot
    return shots * max(traces.bytes_of(1), min(traces.bytes_of(traces.emissions), BLOCK_BYTES // shots))


def pixels_of(traces: Traces, width_m: float, settings: Settings) -> int:
    """Pixels along a side of the reflection image."""
    wavelength = traces.water_mps / traces.frequency_hz
    return side_pixels(width_m, pixel_size(settings.numerics.pixel_m, width_m, wavelength))


def reflection_task_sizes(scan: Summary, settings: Settings) -> Sizes:
    """Sizes of the tasks of a reflection image, by name; none without one."""
    traces = scan.echoes
    if traces is None or not settings.reflection.enabled:
        return {}
    nodes, pixels = settings.grid_nodes**2, pixels_of(traces, scan.width_m, settings) ** 2
    samples = traces.receivers * traces.samples
    signals = samples * upsampling(traces.rate_hz, traces.frequency_hz)
    batch = min(emissions_per_task(traces.receivers, signals // traces.receivers), traces.emissions)
    given = {"element times": scan.emitters * nodes, "read traces": read_bytes(traces)}
    there = 0
    if echo_engine(settings) == "opencl":
        # A processor as a device has its buffers in the memory of the worker.
        there = 8 * batch * signals + 4 * scan.emitters * nodes
        there += 16 * (scan.emitters + batch) * min(PIXELS, pixels)
    return {
        "solve_element_times": TaskSize("solve_element_times", {"images": nodes}),
        "measure_scan_pulse": TaskSize("measure_scan_pulse", {**given, "samples": samples}),
        "sum_emissions": TaskSize(
            "sum_emissions", {**given, "pixels": pixels, "signals": batch * signals, "buffers": there}
        ),
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
