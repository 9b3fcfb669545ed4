"""Table 8 of the dissertation: times of one projection and of reconstructions, theirs and ours."""

import math
import time
from collections.abc import Iterable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace

import numpy as np

from bentray_kernels import eikonal
from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring, TravelTimeScan
from bentray_kernels.opencl import select_device
from bentray_kernels.phantoms import TABLE6_SIDE_M, TABLE7_SIDE_M, table6
from bentray_kernels.tomography import Settings
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import BEST_CONSTANT, STRAIGHT_RAYS, WATER_ALONE, Row
from bentray_workers.cluster.connection import Cluster, open_cluster
from bentray_workers.simulation.plane import ring_radius

from ..shared._baselines import Compared
from ..shared._reconstruction_on_workers import reconstruct_file
from ..shared._timing import least_seconds
from ._kept_times import travel_times
from ._phantom_scan import PhantomScan
from ._table7_slices import varied
from .chapter7_readings import EASY, PUBLISHED
from .reconstruction_time import repeated

SOURCES = 64
SIDES = (128, 256)

# Of a volume: nodes along a side, slices, transducers, and those that emit while a slice is timed.
VOLUMES, QUICK_VOLUMES = ((128, 40, 256, 256), (256, 44, 512, 128)), ((32, 4, 32, 16),)

# Workers that this machine has no cores for.
MODELLED = (4, 16)


@dataclass(frozen=True)
class Column:
    """A column of Table 8.

    Attributes:
        name: solver and hardware, as the table heads them.
        hardware: what chapter 7.3 tells of it.
        seconds: of a projection and of a reconstruction, by nodes along a side.
        ours: the method that is put beside it.
        workers: that reconstruct our volumes, each a slice at a time.
    """

    name: str
    hardware: str
    seconds: dict[int, tuple[float, float]]
    ours: str
    workers: int = 1


COLUMNS = (
    Column("FMM CPU", "a 2.8 GHz Pentium 4", {128: (0.025, 2400), 256: (0.097, 19200)}, "fmm"),
    Column("FSM CPU", "a CPU", {128: (0.031, 2649), 256: (0.180, 32732)}, "fsm"),
    Column("FSM cluster", "a cluster of 8 nodes", {128: (0.007, 506), 256: (0.039, 6393)}, "fsm", 2),
    Column("FIM CPU", "a CPU", {128: (0.038, 3316), 256: (0.189, 37221)}, "fim"),
    # The table's heading says 8086GTX, the text 8800 GTX.
    Column("FIM GPU 8800 GTX", "an 8800 GTX", {128: (0.00082, 37.8), 256: (0.0023, 286.2)}, "fim-opencl"),
    Column("FIM GPU Tesla", "a Tesla", {128: (0.00072, 30.9), 256: (0.0022, 225.76)}, "fim-opencl"),
)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """A row a cell and a way to solve; ``quick`` covers one small size."""
    sides = SIDES[:1] if context.quick else SIDES
    names = tuple(dict.fromkeys(column.ours for column in COLUMNS))
    device, refusal = opencl()
    for i, nodes in enumerate(sides):
        figures_of: dict[str, dict[str, float]] = {}
        for k, name in enumerate(names):
            context.progress(i * len(names) + k, len(sides) * len(names), f"{name} {nodes}²")
            if device or not eikonal.METHODS[name].on_device:
                figures_of[name] = measured(name, nodes)
        for column in COLUMNS:
            ran_on = device if eikonal.METHODS[column.ours].on_device else "one core"
            yield from beside(column, nodes, figures_of.get(column.ours), ran_on, refusal)
    for nodes, slices, transducers, emitters in QUICK_VOLUMES if context.quick else VOLUMES:
        context.progress(0, len(COLUMNS), f"times of {nodes}², {transducers} transducers")
        scan = easiest_slice(context, nodes, transducers, emitters)
        yield from reconstructions(context, scan, slices, device, refusal)
    context.progress(1, 1, "done")


def beside(
    column: Column, nodes: int, figures: dict[str, float] | None, ran_on: str, refusal: str
) -> Iterable[Row]:
    """Our figures beside one cell of the table."""
    goal, _ = column.seconds[nodes]
    theirs = f"theirs {goal * 1e3:g} ms on {column.hardware}, 2008"
    label = f"Table 8 {nodes}² {column.name}"
    if figures is None:
        yield Row(label, None, goal, "<=", "s", f"no OpenCL device: {refusal}; {theirs}")
        return
    for way, seconds in figures.items():
        times = f"{goal / seconds:.3g} times as fast"
        how = f"{column.ours} {seconds * 1e3:.3g} ms on {ran_on}, {times}; {theirs}"
        yield Row(f"{label}, {way}", seconds, goal, "<=", "s", how)


def measured(name: str, nodes: int) -> dict[str, float]:
    """Seconds of a projection through the breast of Table 6 in water of 1500 m/s, emitters on a ring.

    Alone, and as one of many where the method takes many together; of the processor except on a device.
    """
    clock = time.perf_counter if eikonal.METHODS[name].on_device else time.process_time
    speed = table6(1500.0).speed(nodes, TABLE6_SIDE_M)
    spacing = TABLE6_SIDE_M / (nodes - 1)
    angle = 2.0 * np.pi * np.arange(SOURCES) / SOURCES
    ring = TABLE6_SIDE_M * (0.5 + 0.475 * np.column_stack((np.cos(angle), np.sin(angle))))
    figures = {"single": least_seconds(lambda: eikonal.solve(speed, spacing, ring[0], name), clock)}
    if eikonal.METHODS[name].batched:
        together = least_seconds(lambda: eikonal.solve_many(speed[None], spacing, ring, name), clock)
        figures[f"of {SOURCES}"] = together / SOURCES
    return figures


def opencl() -> tuple[str, str]:
    """The device that ``fim-opencl`` runs on, empty where there is none, and why it is none."""
    choice = select_device()
    if choice.device is not None:
        return choice.device.label, ""
    return "", "; ".join(choice.refusals) or "this machine has none"


def easiest_slice(context: BenchmarkContext, nodes: int, transducers: int, emitters: int) -> PhantomScan:
    """The slice at the centre as bent rays image it best: without skin, in water as fast as fat."""
    ring = Ring(transducers, ring_radius(TABLE7_SIDE_M, nodes))
    scan = TravelTimeScan(varied(EASY.coupling_mps, EASY.skin).at(0.0), ring, TABLE7_SIDE_M, nodes)
    everyone = np.arange(transducers)
    emitting = everyone[:: transducers // emitters]
    delta = travel_times(scan, emitting.tolist(), context.progress)
    dataset = Dataset(ring.positions(), emitting, everyone, EASY.coupling_mps, delta_tof_s=delta)
    return PhantomScan(scan, dataset, context.progress)


@dataclass(frozen=True)
class Run:
    """A reconstruction of some slices by some workers.

    Attributes:
        seconds: of a slice on one worker, if all transducers emitted.
        compared: error of the image of a slice and of its baselines.
        detail: what was timed.
    """

    seconds: float
    compared: Compared
    detail: str


def reconstructions(
    context: BenchmarkContext, scan: PhantomScan, slices: int, device: str, refusal: str
) -> Iterable[Row]:
    """Rows of a volume whose slices are all that of a scan: by each column, and by more workers in a model.

    Args:
        scan: of one slice.
        slices: of the volume.
        device, refusal: as ``opencl``.
    """
    nodes = scan.scan.nodes
    runs: dict[tuple[str, int], Run] = {}
    for column in COLUMNS:
        _, goal = column.seconds.get(nodes, (0.0, math.inf))
        theirs = f"theirs {goal:g} s on {column.hardware}, 2008"
        label = f"Table 8 {nodes}² by {slices} {column.name}"
        if eikonal.METHODS[column.ours].on_device and not device:
            yield Row(label, None, goal, "<=", "s", f"no OpenCL device: {refusal}; {theirs}")
            continue
        way = column.ours, column.workers
        run = runs[way] = runs.get(way) or reconstructed(context, scan, *way)
        if column.workers == 1:
            details = {label: (1, run.detail)}
        else:
            details = {f"{label}, {column.workers} workers": (column.workers, run.detail)}
            model = f"slices of {run.seconds:.3g} s, one after the other on each worker, without scheduling"
            details |= {f"{label}, {count} workers, modelled": (count, model) for count in MODELLED}
        for name, (workers, detail) in details.items():
            seconds = math.ceil(slices / workers) * run.seconds
            yield run.compared.row(name, seconds, goal, "<=", "s", f"{theirs}; {detail}")


def reconstructed(context: BenchmarkContext, scan: PhantomScan, method: str, workers: int) -> Run:
    """Time SART by one Eikonal solver by the clock, a slice on each worker; one works in this process."""
    nodes, dataset = scan.scan.nodes, scan.dataset
    assert dataset.delta_tof_s is not None
    settings = Settings.from_values(
        method="sart",
        eikonal=method,
        nodes=nodes,
        side_m=TABLE7_SIDE_M,
        attenuation=False,
        # Otherwise the receivers of the emitters that are left out would emit.
        reciprocity=False,
        **PUBLISHED,
    )
    single = replace(dataset, delta_tof_s=dataset.delta_tof_s[None], slice_z_m=np.zeros(1))
    many = repeated(single, nodes, workers)
    assert many.delta_tof_s is not None
    few = replace(many, tx=many.tx[:4], delta_tof_s=many.delta_tof_s[:, :4])
    what = f"{nodes}², {method}, {workers} workers"
    with open_cluster(workers=workers) if workers > 1 else nullcontext() as cluster:
        # To compile.
        reconstruct_file(few, replace(settings, iterations=1), context, cluster, what)
        before = processor_seconds(cluster)
        result, clock = reconstruct_file(many, settings, context, cluster, what)
        busy = max(after - before[name] for name, after in processor_seconds(cluster).items())
    image = replace(result, speed=result.speed[..., 0], coverage=result.coverage[..., 0])
    inside, error = scan.rms(image).of(image), scan.whole_image_rms(image)
    values = {BEST_CONSTANT: error.best_constant, WATER_ALONE: dataset.water_speed_mps}
    baselines = {name: error.of_constant(value) for name, value in values.items()}
    compared = Compared(error.of(image), baselines | {STRAIGHT_RAYS: error.of(scan.images.straight(image))})
    detail = (
        f"SART, {method}, {settings.iterations} iterations; timed: a slice on each worker, {len(dataset.tx)} "
        f"of {len(dataset.rx)} transducers emit, {clock:.1f} s by the clock, {busy:.1f} s of its processor; "
        f"without skin, water {dataset.water_speed_mps:g} m/s: NRMSE {compared.error:.3f} of "
        f"the whole image, {inside:.3f} inside"
    )
    return Run(clock * len(dataset.rx) / len(dataset.tx), compared, detail)


def processor_seconds(cluster: Cluster | None) -> Mapping[str, float]:
    """Processor time so far of each worker, or of this process, s."""
    if cluster is None:
        return {"": time.process_time()}
    return dict(cluster.client.run(time.process_time))
