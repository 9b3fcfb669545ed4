"""Counts that the memory of a reflection image grows with, its tasks and its time."""

from __future__ import annotations

import math

from bentray_kernels.tomography.reflection.delay_and_sum_opencl import PIXELS, SUM_BYTES, VIEW_BYTES
from bentray_kernels.tomography.reflection.echoes import upsampling
from bentray_kernels.tomography.reflection.reflection_graph import ELEMENTS, PULSE_EMISSIONS
from bentray_kernels.tomography.reflection.reflection_plan import emissions_per_task, pixel_size, side_pixels
from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.solver_choice import echo_engine

from ..cluster.capacities import REAL
from ..cluster.task_costs import TaskSize
from ..files.dataset.counts import Summary, Traces
from .ray_task_sizes import front_size


def pixels_of(traces: Traces, width_m: float, settings: Settings) -> int:
    """Pixels along a side of the image."""
    wavelength = traces.water_mps / traces.frequency_hz
    return side_pixels(width_m, pixel_size(settings.reflection.pixel_m, width_m, wavelength))


def reflection_task_sizes(scan: Summary, settings: Settings) -> dict[str, TaskSize]:
    """The tasks by name; empty without a reflection image.

    Args:
        scan: the dataset.
        settings: with nodes.
    """
    traces = scan.echoes
    if traces is None or not settings.reflection.enabled:
        return {}
    nodes, side = settings.grid_nodes, pixels_of(traces, scan.width_m, settings)
    field = (nodes + 3) ** 2
    factor = upsampling(traces.rate_hz, traces.frequency_hz)
    samples = traces.receivers * traces.samples
    batch = min(emissions_per_task(traces.receivers, traces.samples * factor), traces.emissions)
    on_device = 0
    if echo_engine(settings) == "opencl":
        # A processor as a device has its buffers in the memory of the worker.
        on_device = 8 * batch * samples * factor + 4 * scan.emitters * field
        on_device += (VIEW_BYTES * scan.emitters + SUM_BYTES * batch) * min(PIXELS, side**2)
    counts = {
        "nodes": nodes**2,
        "nodes of a task's times": ELEMENTS * field,
        "nodes of all times": scan.emitters * field,
        "pixels": side**2,
        "bytes of a read": traces.read_bytes,
        "bytes of water shots": traces.read_bytes if traces.water_shot else 0,
        "samples of an emission": samples,
        "samples of the pulse": min(PULSE_EMISSIONS, traces.emissions) * samples,
        "samples of signals": samples * factor,
        "samples of all signals": batch * samples * factor,
        "emissions and receivers": batch + traces.receivers,
        "bytes on the device": on_device,
        "bytes of a wave front": front_size((nodes, nodes), "accurate").bytes,
    }
    names = ("solve_element_times", "measure_scan_pulse", "sum_emissions")
    return dict.fromkeys(names, TaskSize("echoes", counts))


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
    """CPU time of all slices, s; 0 without a reflection image."""
    traces = scan.echoes
    if traces is None or not settings.reflection.enabled:
        return 0.0
    side = pixels_of(traces, scan.width_m, settings)
    pairs = scan.slices * traces.emissions * traces.receivers
    return TaskSize("summed echoes", {"pixels of pairs": pairs * side**2}).seconds
