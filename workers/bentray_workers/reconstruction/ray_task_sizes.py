"""Counts that the memory of tasks grows with: picking, rays, and updates of an image by travel times."""

from __future__ import annotations

import math

from bentray_kernels.acquisition.picking.gate import FREQUENCIES
from bentray_kernels.acquisition.picking.pickers import PICKERS
from bentray_kernels.acquisition.picking.pulse import AFTER, BEFORE
from bentray_kernels.acquisition.reference import chords_of_emission
from bentray_kernels.eikonal.diagonals import Diagonals
from bentray_kernels.rays.block_tracing import ABOVE, BELOW, GUARD
from bentray_kernels.tomography.problem import MARGIN_NODES
from bentray_kernels.tomography.sart.device_slices import PROCESSOR_SLICES, SliceSize
from bentray_kernels.tomography.sart.sart_update import smoothing_reach
from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.solver_choice import sart_engine, solver_of

from ..cluster.task_costs import TaskSize
from ..files.dataset.counts import Summary

# Problems that a process keeps, of slices and stages.
PROBLEMS_KEPT = 8

# Larger arrays go back to the system when they are freed (glibc), in numbers of 8 bytes.
FREED_NODES = 32 * 2**20 // 8

Sizes = dict[str, TaskSize]


def shape_of(scan: Summary, settings: Settings) -> tuple[int, ...]:
    """Shape of an image, as ``Problem.from_dataset`` makes it."""
    nodes = settings.grid_nodes
    if settings.decomposition != "volume":
        return nodes, nodes
    side = settings.side_m or scan.width_m * (nodes - 1) / (nodes - 1 - 2 * MARGIN_NODES)
    heights = math.ceil(scan.height_m * (nodes - 1) / side) + 1 + 2 * MARGIN_NODES
    return nodes, nodes, heights


def emitters_of(scan: Summary, settings: Settings) -> int:
    """Number of emitters of one problem."""
    return scan.emitters * (scan.slices if settings.decomposition == "volume" else 1)


def problems_of(scan: Summary, settings: Settings) -> int:
    """Number of problems: one for each slice, or the volume."""
    return 1 if settings.decomposition == "volume" else scan.slices


def entries_of(scan: Summary, settings: Settings, rays: int) -> int:
    """Matrix entries of rays in units of one per node of a side; in space a step touches twice as many."""
    level = settings.decomposition != "volume" or (settings.rays == "straight" and not scan.in_space)
    return rays * settings.grid_nodes * (1 if level else 2)


def rays_of(scan: Summary, settings: Settings) -> int:
    """Number of rays of one problem that are held at the same time."""
    rays = emitters_of(scan, settings) * scan.receivers
    return -(-rays // 2) if settings.method == "gauss-newton" and settings.numerics.reciprocity else rays


def front_size(shape: tuple[int, ...], method: str) -> TaskSize:
    """One travel time with the data for ray tracing; ``method`` is one of ``eikonal.methods()``."""
    return TaskSize(f"travel time {method}{_space(shape)}", {"nodes": int(Diagonals.from_shape(shape).size)})


def ray_task_sizes(scan: Summary, settings: Settings) -> Sizes:
    """The tasks of one method that trace rays or use them, by name.

    Args:
        scan: the dataset.
        settings: of one method; never ``method`` auto.
    """
    shape = shape_of(scan, settings)
    space, straight = _space(shape), _straight(settings)
    counts = _ray_counts(scan, settings)
    if settings.method == "gauss-newton":
        kind, names = "gauss-newton" + straight + space, ["trace_rays", "update_gauss_newton"]
    elif sart_engine(settings, len(shape)) == "opencl":
        kind, names = "sart on a device", ["update_sart_slices"]
    elif settings.numerics.blocks > 1:
        counts = _block_counts(shape, scan.receivers, settings)
        kind, names = "blocks" + straight, ["trace_rays_in_block", "back_project_in_block", "update_block"]
        names += [] if straight else ["sweep_block"]
    else:
        compiled = solver_of(settings, len(shape)).compiled
        kind, names = "sart" + (" compiled" if compiled else "") + straight + space, ["update_sart"]
    sizes = dict.fromkeys(names, TaskSize(kind, counts))
    maps = TaskSize("maps" + straight + space, _ray_counts(scan, settings))
    if settings.attenuation.enabled and scan.amplitudes:
        sizes |= dict.fromkeys(("trace_attenuation_rays", "solve_attenuation"), maps)
    if settings.resolution_check:
        sizes |= dict.fromkeys(("trace_final_rays", "check_resolution"), maps)
    if settings.uncertainty:
        bent = settings.changed(rays="curved")
        rays = rays_of(scan, settings)
        if settings.numerics.reciprocity and settings.method != "gauss-newton":
            rays = -(-rays // 2)
        once = {"rays": rays, "entries of rays": entries_of(scan, bent, rays)}
        probed = TaskSize("uncertainty" + (space or f" by {settings.method}"), _ray_counts(scan, bent) | once)
        sizes |= dict.fromkeys(("trace_uncertainty_rays", "estimate_uncertainty"), probed)
    return sizes


def _space(shape: tuple[int, ...]) -> str:
    return " in space" if len(shape) == 3 else ""


def _straight(settings: Settings) -> str:
    return " straight" if settings.rays == "straight" else ""


def _ray_counts(scan: Summary, settings: Settings) -> dict[str, float]:
    shape, rays = shape_of(scan, settings), rays_of(scan, settings)
    problems, entries = problems_of(scan, settings), entries_of(scan, settings, rays)
    # A process caches times and losses of the dataset, and those of recent problems.
    kept = min(PROBLEMS_KEPT, problems * (settings.numerics.coarser_grids + 1))
    on_device = 0
    if sart_engine(settings, len(shape)) == "opencl":
        # All slices are updated in one task.
        kept = problems
        # A processor as a device has its arrays in the memory of the worker; a GPU has its own.
        on_device = min(scan.slices, PROCESSOR_SLICES) * slice_bytes(scan, settings)
    return {
        "pairs of the scan": scan.pairs,
        "pairs of problems": kept * emitters_of(scan, settings) * scan.receivers,
        "nodes": math.prod(shape),
        "nodes of all images": problems * math.prod(shape),
        "rays": rays,
        "entries of rays": entries,
        # While one slice is updated, rays of another are traced already.
        "entries of other slices": entries if problems > 1 else 0,
        "steps of rays": scan.receivers * sum(shape),
        "bytes of a wave front": _front_bytes(scan, settings),
        "bytes on the device": on_device,
    }


def slice_bytes(scan: Summary, settings: Settings) -> int:
    """Device memory of one slice that is updated by SART."""
    nodes = settings.grid_nodes
    return SliceSize((nodes, nodes), scan.emitters, scan.receivers, 1, settings.numerics.subset).bytes


def picking_task_sizes(scan: Summary, settings: Settings) -> Sizes:
    """The tasks that examine and pick a scan, by name. A task reads one emission after the other."""
    traces = scan.traces if scan.traces_bytes else None
    names = ["finish_slice", "write_picked"]
    counts: dict[str, float] = {"pairs of the scan": scan.pairs}
    if traces is None:
        # Times are examined alone.
        return dict.fromkeys(names if settings.picking.examine else (), TaskSize("examined times", counts))
    samples, cycle = traces.receivers * traces.samples, traces.rate_hz / traces.frequency_hz
    of_slice = traces.emissions * traces.receivers
    estimated = not traces.water_shot
    amplitudes = traces.receivers if settings.reads_amplitudes else 0
    counts |= {
        "bytes of a read": traces.read_bytes,
        "samples of an emission": samples,
        "filtered samples": samples if PICKERS[settings.picking.picker].filtered else 0,
        "samples of gates": amplitudes * ((BEFORE + AFTER) * cycle + 1),
        "frequencies": amplitudes * FREQUENCIES,
        "samples of pulses": of_slice * (2 * cycle + 1),
        "estimated samples": samples if estimated else 0,
        "chords": traces.emissions * chords_of_emission(traces.emissions) if estimated else 0,
    }
    names.append("pick_emissions")
    names += ["find_chords", "read_chords", "estimate_slice_water"] if estimated else []
    names += ["measure_traces"] if settings.picking.examine or estimated else []
    names += ["examine_slice"] if settings.picking.examine else []
    # Without a water shot no traces are read again once it is estimated.
    return dict.fromkeys(names, TaskSize("picking" + (" without water" if estimated else ""), counts))


def _front_bytes(scan: Summary, settings: Settings) -> int:
    """Of the travel time of one emitter, in the whole image."""
    if settings.rays == "straight":
        return 0
    return front_size(shape_of(scan, settings), settings.ray_eikonal).bytes


def _block_counts(shape: tuple[int, ...], receivers: int, settings: Settings) -> dict[str, float]:
    blocks, plane = min(settings.numerics.blocks, shape[0]), math.prod(shape[1:])
    own = -(-shape[0] // blocks)
    near = min(own + BELOW + ABOVE + 2 * GUARD, shape[0])
    return {
        "nodes of a block": near * plane,
        "freed nodes": min(near * plane, FREED_NODES),
        "smoothed nodes": min(own + 2 * smoothing_reach(settings), shape[0]) * plane,
        "swept nodes": int(Diagonals.from_shape((own, *shape[1:])).size),
        "points of rays": receivers * max(shape) * len(shape),
    }
