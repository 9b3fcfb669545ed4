"""Whole reconstructions on an OpenCL device beside the times of the dissertation's graphics card."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.opencl import Device
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.tomography import Settings
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.files.dataset import read_dataset
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.waves import WaveSimulationSettings

from ..shared._image_error import object_error
from ..shared._reconstruction_on_workers import reconstruct_file
from ..shared._recorded_scans import OTHERS, SMALL

COUPLING_MPS = 1375.0
ITERATIONS = 3

# Nodes along a side, slices, transducers, the seconds asked for, and those of the dissertation's Tesla.
VOLUMES = ((128, 40, 256, 30.9, 30.9), (256, 44, 512, 3.0, 225.76))
QUICK_VOLUME = (32, 4, 16, 3.0, None)

WAVEFORM_S = 6.0

ON_PROCESSORS = (
    "takes up to hours on a processor, so it is measured on other devices; --quick takes a small one"
)


def whole_runs(context: BenchmarkContext, device: Device) -> Iterable[Row]:
    """Times of volumes by SART and of full waveforms; small ones in a quick run."""
    for nodes, slices, elements, goal, theirs in (QUICK_VOLUME,) if context.quick else VOLUMES:
        label = f"D1 {nodes}² by {slices}, {elements} transducers, {ITERATIONS} iterations"
        if device.kind == "cpu" and not context.quick:
            yield Row(label, None, goal, "<=", "s", ON_PROCESSORS)
            continue
        dataset = volume(nodes, slices, elements)
        settings = Settings.from_values(
            method="sart", device="opencl", nodes=nodes, side_m=TABLE6_SIDE_M, iterations=ITERATIONS
        )
        tiny = replace(settings, iterations=1)
        seconds = timed(dataset, settings, tiny, context, label)
        detail = f"{device.label}, driver {device.driver}; slices of Table 6, times on the grid of the image"
        yield Row(label, seconds, goal, "<=", "s", detail + (f"; theirs {theirs} s" if theirs else ""))
    yield from waveforms(context, device)


def waveforms(context: BenchmarkContext, device: Device) -> Iterable[Row]:
    """Time of full waveforms, with the error of the image."""
    if context.quick:
        yield waveform(
            "D1 full waveforms, simulated 300 kHz", simulate(replace(SMALL, snr=30.0)), context, device
        )
        return
    scans: tuple[tuple[str, Callable[[], Dataset]], ...] = (
        ("simulated 500 kHz", lambda: simulate(WaveSimulationSettings(snr=30.0))),
        ("ring_wave_a", lambda: read_dataset(OTHERS)),
    )
    for name, made in scans:
        label = f"D1 full waveforms, {name}"
        if device.kind == "cpu":
            yield Row(label, None, WAVEFORM_S, "<=", "s", ON_PROCESSORS)
        elif name == OTHERS.stem and not OTHERS.exists():
            yield Row(label, None, WAVEFORM_S, "<=", "s", f"{OTHERS.name} is not on this machine")
        else:
            yield waveform(label, made(), context, device)


def waveform(label: str, dataset: Dataset, context: BenchmarkContext, device: Device) -> Row:
    """The row of one scan with traces and truth."""
    settings = Settings(method="waveform", device="opencl")
    result, seconds = reconstruct_file(dataset, settings, context, None, label, threads=None)
    error = object_error(dataset)(result)
    constant, water = error.of_constant(error.best_constant), error.of_constant(dataset.water_speed_mps)
    detail = (
        f"{device.label}, driver {device.driver}; error {error.of(result):.2f} m/s, "
        f"best constant {constant:.1f}, water alone {water:.1f}"
    )
    return Row(label, seconds, WAVEFORM_S, "<=", "s", detail)


def volume(nodes: int, slices: int, elements: int) -> Dataset:
    """A scan of slices that are all the same."""
    ring, everyone = Ring(elements, 0.45 * TABLE6_SIDE_M), np.arange(elements)
    scan = TravelTimeScan(table6(COUPLING_MPS), ring, TABLE6_SIDE_M, nodes=nodes)
    times = scan.delta_tof(everyone)
    return Dataset(
        ring.positions(),
        everyone,
        everyone,
        COUPLING_MPS,
        delta_tof_s=np.broadcast_to(times, (slices, *times.shape)).copy(),
        slice_z_m=np.arange(slices) * TABLE6_SIDE_M / (nodes - 1),
    )


def timed(
    dataset: Dataset, settings: Settings, warm: Settings, context: BenchmarkContext, what: str
) -> float:
    """Seconds of a reconstruction in this process, programs built before."""
    assert dataset.delta_tof_s is not None
    assert dataset.slice_z_m is not None
    few = replace(dataset, delta_tof_s=dataset.delta_tof_s[:2], slice_z_m=dataset.slice_z_m[:2])
    reconstruct_file(few, warm, context, None, what, threads=None)
    return reconstruct_file(dataset, settings, context, None, what, threads=None).seconds
