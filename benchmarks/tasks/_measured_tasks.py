"""The jobs whose tasks are measured for the table of task costs, and sizes of each to check it with."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from distributed import Client

from bentray_kernels import eikonal
from bentray_kernels.rays.fan import Fan
from bentray_kernels.splines import coefficients
from bentray_kernels.tomography import Settings
from bentray_workers.cluster.task_costs import TaskSize
from bentray_workers.files.dataset.summary import summary_of
from bentray_workers.reconstruction.ray_task_sizes import (
    front_size,
    picking_task_sizes,
    ray_task_sizes,
)
from bentray_workers.reconstruction.reconstruction_cost import passes_of
from bentray_workers.reconstruction.reconstruction_run import reconstruct
from bentray_workers.reconstruction.reflection_sizes import pixels_of, reflection_task_sizes
from bentray_workers.reconstruction.waveform_sizes import wave_task_sizes

from ..shared._synthetic_scan import made_up_scan, made_up_traces
from ._task_peaks import Peak, call, measured, measured_in_fork, set_idle

# Among the planned sizes of a job: the counts of its CPU time.
WORK = "all tasks"


class Measured(NamedTuple):
    """Tasks of one kind in one job: what the counts of the table are, and what they took at most.

    Attributes:
        job: its name.
        kind, counts: see ``TaskSize``.
        bytes: above an idle worker; 0 for the CPU time of a whole job.
        seconds: CPU time of all; 0 for a task of a job.
        size: of the job.
        check: whether the table is compared with it, and not fitted to it.
    """

    job: str
    kind: str
    counts: Mapping[str, float]
    bytes: int
    seconds: float
    size: str = ""
    check: bool = False

    @property
    def planned_bytes(self) -> int:
        """What the table gives."""
        return TaskSize(self.kind, self.counts).bytes


class Job(NamedTuple):
    """Jobs of one kind and several sizes.

    Attributes:
        name: of the kind.
        run: on a worker, with a folder for files and a size; returns the planned sizes of its tasks by name.
        warm: a size with few data, which loads compiled code on a worker; None: each size runs in a fork, so
            that the libraries that a task loads are a part of its memory.
        sizes: to which the table is fitted.
        checks: others, with which it is compared.
        tasks: whose sizes count; empty: all that are planned.
    """

    name: str
    run: Callable[..., dict[str, TaskSize]]
    warm: Any
    sizes: Sequence[Any]
    checks: Sequence[Any] = ()
    tasks: tuple[str, ...] = ()

    def measure(self, client: Client | None, folder: Path, *, checks: bool) -> Iterator[Measured]:
        """The tasks of each size, one for each kind of task, and one for the work of the whole job.

        Args:
            client: of ``metered_worker``; None for jobs that run in forks.
            folder: for files.
            checks: whether to measure the sizes of the checks.
        """
        if client is not None:
            self.run(client, folder, self.warm)
            set_idle(client)
        for size in self.checks if checks else self.sizes:
            if client is None:
                planned, peaks = measured_in_fork(self.run, folder, size)
            else:
                planned, peaks = measured(client, self.run, folder, size)
                set_idle(client)
            for task in self._tasks(planned, peaks):
                yield task._replace(size=str(size), check=checks)

    def _tasks(self, planned: dict[str, TaskSize], peaks: dict[str, Peak]) -> Iterator[Measured]:
        names = [name for name in self.tasks or planned if name in peaks]
        kinds: list[TaskSize] = []
        for size in (planned[name] for name in names):
            kinds += [] if size in kinds else [size]
        for task in kinds:
            same = [peaks[name] for name in names if planned[name] == task]
            # Tasks of jobs are timed together.
            used = 0.0 if self.warm else round(sum(peak.seconds for peak in same), 2)
            yield Measured(self.name, *task, max(peak.bytes for peak in same), used)
        if work := planned.get(WORK):
            yield Measured(self.name, *work, 0, round(sum(peak.seconds for peak in peaks.values()), 2))


def by_times(
    asked: dict[str, Any], client: Client, folder: Path, size: tuple[int, int, int]
) -> dict[str, TaskSize]:
    """Reconstruct from travel times and losses; the size is of elements, nodes and slices."""
    elements, nodes, slices = size
    # Few rings, far from each other, where a volume is cut into blocks: a task for each block and emitter.
    pitch_m = 0.05 if "blocks" in asked else 0.003
    path = made_up_scan(folder / "scan.h5", elements, slices, losses=True, pitch_m=pitch_m)
    settings = Settings.from_values(
        **{"nodes": nodes, "iterations": 2, "decomposition": "slices", "attenuation": False, **asked}
    )
    reconstruct(client, path, settings)
    scan = summary_of(path, settings)
    sizes = {**picking_task_sizes(scan, settings), **ray_task_sizes(scan, settings)}
    if asked == {"method": settings.method}:
        kind, counts = passes_of(scan, settings)
        sizes[WORK] = TaskSize(kind, {name: scan.slices * count for name, count in counts.items()})
    return sizes


MAPS = {"attenuation": True, "resolution_check": True, "uncertainty": True}
MAP_TASKS = (
    "trace_attenuation_rays",
    "solve_attenuation",
    "trace_final_rays",
    "check_resolution",
    "trace_uncertainty_rays",
    "estimate_uncertainty",
)
# Elements, nodes along a side, and slices or heights; a check after them.
FEW = ((64, 64, 1), (128, 128, 1), (288, 128, 1), (96, 256, 1), (32, 160, 1)), ((160, 144, 1),)
MANY = (
    (*FEW[0], (256, 192, 3), (512, 256, 1), (128, 96, 12), (64, 400, 1)),
    (*FEW[1], (400, 224, 1), (192, 160, 6)),
)
LEVELS = ((64, 64, 1), (128, 128, 3), (256, 192, 2), (64, 96, 12)), ((100, 128, 6),)
VOLUMES = ((12, 48, 8), (24, 64, 12), (32, 64, 6), (24, 80, 8), (16, 112, 10)), ((20, 72, 9),)
BLOCKS = ((6, 64, 2), (6, 96, 2), (8, 128, 2), (64, 96, 2), (6, 192, 2)), ((12, 112, 2), (6, 160, 2))
SPACE, SLAB = {"decomposition": "volume"}, {"decomposition": "volume", "blocks": 3, "iterations": 1}
TIMED: tuple[tuple[dict[str, Any], Any, tuple[str, ...]], ...] = (
    ({"method": "sart"}, MANY, ()),
    ({"method": "gauss-newton"}, MANY, ()),
    ({"method": "gauss-newton", "rays": "straight"}, FEW, ()),
    ({"method": "sart", "eikonal": "accurate"}, FEW, ()),
    ({"method": "sart", "rays": "straight"}, ((*FEW[0], *FEW[1]), ((112, 112, 1),)), ()),
    ({"method": "sart", **MAPS}, FEW, MAP_TASKS),
    ({"method": "gauss-newton", **MAPS}, FEW, MAP_TASKS),
    ({"method": "gauss-newton", "rays": "straight", **MAPS}, FEW, MAP_TASKS),
    ({"method": "sart", "device": "opencl"}, LEVELS, ()),
    ({"method": "sart", **SPACE}, VOLUMES, ()),
    ({"method": "sart", "rays": "straight", **SPACE}, VOLUMES, ()),
    ({"method": "gauss-newton", **SPACE}, VOLUMES, ()),
    ({"method": "gauss-newton", "rays": "straight", **SPACE}, VOLUMES, ()),
    ({"method": "gauss-newton", **SPACE, **MAPS}, VOLUMES, MAP_TASKS),
    ({"method": "gauss-newton", "rays": "straight", **SPACE, **MAPS}, VOLUMES, MAP_TASKS),
    ({"method": "sart", **SLAB}, BLOCKS, ()),
    ({"method": "sart", "rays": "straight", **SLAB}, BLOCKS, ()),
)


def _named(*settings: dict[str, Any]) -> str:
    return ", ".join(f"{key} {value}" for some in settings for key, value in some.items())


def timed_jobs() -> Iterator[Job]:
    """Reconstructions from travel times."""
    for asked, (sizes, checks), tasks in TIMED:
        small = (6, 24, 2) if "blocks" in asked else (16, 24, 3 if "decomposition" in asked else 1)
        yield Job(f"times, {_named(asked)}", partial(by_times, asked), small, sizes, checks, tasks)


def by_front(method: str, client: Client, folder: Path, shape: tuple[int, ...]) -> dict[str, TaskSize]:
    """Solve one travel time with the data for rays."""
    call(client, solve_front, shape, method)
    return {solve_front.__name__: front_size(shape, method)}


def solve_front(shape: tuple[int, ...], method: str) -> None:
    """Task: a travel time through even speeds, the source off the middle, and what rays need of both."""
    speed, spacing = np.full(shape, 1500.0), 1e-3
    source, receiver = (part * spacing * np.array(shape) for part in (0.4, 0.7))
    tof = eikonal.solve(speed, spacing, source, method)
    spline = coefficients(-np.log(speed))
    assert spline.size
    Fan.checked(tof, spacing, receiver[None], source, "curved", "differences")


def front_jobs() -> Iterator[Job]:
    """Travel times by every method, in two and three dimensions."""
    planes = ((200, 200), (300, 300), (700, 500), (1000, 1000)), ((500, 600),)
    spaces = ((40, 40, 40), (70, 70, 30), (100, 100, 60)), ((80, 80, 50),)
    for method in eikonal.methods():
        for sizes, checks in (planes, spaces):
            small = (16,) * len(sizes[0])
            name = f"travel time in {len(small)}-D, {method}"
            yield Job(name, partial(by_front, method), small, sizes, checks)


def by_traces(
    scan: dict[str, Any], asked: dict[str, Any], client: Client, folder: Path, size: tuple[int, int]
) -> dict[str, TaskSize]:
    """Reconstruct from traces; the size is of elements and samples."""
    elements, samples = size
    path = made_up_traces(folder / "traces.h5", elements, samples, **scan)
    usual = {"method": "sart", "nodes": 48, "iterations": 2, "decomposition": "slices", "attenuation": False}
    settings = Settings.from_values(**{**usual, **asked})
    reconstruct(client, path, settings)
    summary = summary_of(path, settings)
    waves = wave_task_sizes(summary.traces, summary.width_m, settings)
    sizes = {**picking_task_sizes(summary, settings), **waves, **reflection_task_sizes(summary, settings)}
    pairs = elements**2
    if asked.get("picker"):
        sizes[WORK] = TaskSize("picked samples", {"samples": 2 * pairs * samples})
    if asked == {"reflection": True}:
        sizes[WORK] = TaskSize(
            "summed echoes",
            {"pixels of pairs": pairs * pixels_of(summary.traces, summary.width_m, settings) ** 2},
        )
    return sizes


PICKED = ((48, 800), (96, 1500), (100, 2400), (160, 1000), (32, 6000)), ((80, 1800),)
ECHOES = ((24, 1500), (48, 1200), (64, 1500), (96, 800), (16, 4000)), ((72, 1300),)
# The table is not fitted to refinements, see ``waveform_sizes``.
WAVES = (), ((48, 260), (96, 300), (128, 300))
ECHO_TASKS = ("solve_element_times", "measure_scan_pulse", "sum_emissions")
WAVE_TASKS = ("start_band", "evaluate_emitter", "update_image", "validate_image")
DRY, LOW = {"water": False}, {"centre_hz": 2.5e5}
# Settings, scan, sizes, and tasks that count.
TRACED: tuple[tuple[dict[str, Any], dict[str, Any], Any, tuple[str, ...]], ...] = (
    ({}, {}, PICKED, ()),
    ({"picker": "matched"}, {}, PICKED, ()),
    ({}, DRY, PICKED, ()),
    ({"attenuation": True, "amplitudes": "spectrum"}, {}, PICKED, ("pick_emissions",)),
    ({"reflection": True}, {}, ECHOES, ECHO_TASKS),
    ({"reflection": True, "nodes": 128}, DRY, ECHOES, ECHO_TASKS),
    ({"reflection": True, "device": "opencl"}, {}, ECHOES, ECHO_TASKS),
    ({"method": "waveform", "bands": 1, "emitters": 8}, LOW, WAVES, WAVE_TASKS),
    ({"method": "waveform", "bands": 2, "emitters": 16}, LOW, WAVES, WAVE_TASKS),
    ({"method": "waveform", "bands": 1, "emitters": 8, "device": "opencl"}, LOW, WAVES, WAVE_TASKS),
)


def traced_jobs() -> Iterator[Job]:
    """Reconstructions from traces: examination, picking, and images by waves or echoes."""
    for asked, scan, (sizes, checks), tasks in TRACED:
        small = (48 if scan is DRY else 16, 700)
        run = partial(by_traces, scan, asked)
        yield Job(f"traces, {_named(asked, scan)}", run, small, sizes, checks, tasks)


JOBS = (*front_jobs(), *timed_jobs(), *traced_jobs())
