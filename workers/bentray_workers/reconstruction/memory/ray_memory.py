"""Memory of the tasks of a reconstruction beyond that of a warm worker, from the arrays of the kernels.

Compared with measured peaks in ``tests/workers/reconstruction/test_planning.py`` and ``bentray bench
task_memory``. Formulas and no fitted coefficients: these missed volumes of other sizes, up or down.
"""

from __future__ import annotations

import math

from bentray_kernels.eikonal import METHODS
from bentray_kernels.eikonal.diagonals import Diagonals
from bentray_kernels.rays.vectorised import LONGEST
from bentray_kernels.tomography.problem import MARGIN_NODES
from bentray_kernels.tomography.sart.device_slices import PROCESSOR_SLICES, SliceSize
from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.solver_choice import sart_engine, solver_of
from bentray_kernels.tomography.stage_graphs import BATCH
from bentray_kernels.tomography.uncertainty.probe_product import LANES

from ...cluster.capacities import MIB, REAL
from ...files.dataset.counts import Summary
from .block_memory import block_task_parts
from .picking_memory import finish_slice_bytes, join_slices_bytes, picking_task_bytes

# Overhead of Python in any task: half of it on 3.11 and 3.12, all of it on 3.13.
FLOOR_BYTES = 7 * MIB

# Bytes per padded node of a travel time with gradient, spline and copies, without the arrays of the sweeps.
FIELD_BYTES_PER_NODE = 80

# Matrix entries of a ray per node of a side: chords are 0.64 of the ring's width on average, and each step
# between nodes touches the corners of its cells. In 3-D a level ray stays in its plane.
ENTRIES_LEVEL, ENTRIES_IN_SPACE = 1.55, 3.1

# Arrays of the size of all probes of one solve: its iterates, transforms and products, with
# copies, and what the transforms of one processor take more than those of another.
PROBE_ARRAYS = 26

# Problems that a process keeps, of slices and stages.
PROBLEMS_KEPT = 8

# Memory that rays take in a worker over that of the rays of one iteration: those of the next do not fit where
# these were; and while one slice is updated, rays of others are traced already. ``bentray bench sizing``
# measured up to 1.36 for one slice and 2.4 for several.
RAYS_OF_SLICE, RAYS_OF_SLICES = 1.4, 3.0

# An entry is a column of 4 bytes and a length of 4.
ENTRY_BYTES = 8


def field_bytes(shape: tuple[int, ...], method: str) -> int:
    """Peak memory of one travel time with the data for ray tracing.

    Args:
        shape: (nx, ny[, nz]).
        method: one of ``eikonal.methods()``.
    """
    nodes = math.prod(n + 2 for n in shape)
    grids = METHODS[method].swept_grids[len(shape) - 2] if method in METHODS else 0
    swept: int = grids * REAL * Diagonals.from_shape(shape).size
    return FIELD_BYTES_PER_NODE * nodes + swept


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


def rays_of(scan: Summary, settings: Settings) -> int:
    """Number of rays of one problem that are held at the same time."""
    rays = emitters_of(scan, settings) * scan.receivers
    # Elements that only receive are emitters too, of the reverse pairs.
    recorded = -(-scan.pairs // (1 if settings.decomposition == "volume" else scan.slices))
    if settings.method == "gauss-newton" and settings.numerics.reciprocity:
        return min(-(-rays // 2), recorded)
    return min(rays, 2 * recorded)


def _entries(settings: Settings, in_space: bool) -> float:
    """Matrix entries per ray."""
    level = settings.decomposition != "volume" or (settings.rays == "straight" and not in_space)
    return settings.grid_nodes * (ENTRIES_LEVEL if level else ENTRIES_IN_SPACE)


def rows_bytes(scan: Summary, settings: Settings, rays: int) -> int:
    """Memory of rays as ``linearisation.Rows``: their entries, and a pointer and a residual each."""
    return math.ceil(rays * (_entries(settings, scan.in_space) * ENTRY_BYTES + 2 * REAL))


def state_bytes(shape: tuple[int, ...], settings: Settings) -> int:
    """Slowness and coverage; with Gauss–Newton the best image, the start and the dual too."""
    images = 2 if settings.method == "sart" else 4 + len(shape)
    return images * REAL * math.prod(shape)


def call_bytes(scan: Summary, settings: Settings) -> dict[str, int]:
    """Memory of each kind of task of one method, bytes.

    Args:
        scan: the dataset.
        settings: of one method; never ``method`` auto.

    Returns:
        By the name of the task, with those of ``picking_graph`` where traces are picked: working arrays,
        arguments, result, and cached parts of the dataset.
    """
    sizes: dict[str, int] = {}
    if scan.traces_bytes:
        sizes |= picking_task_bytes(scan.recorded, scan.pairs, settings)
    elif settings.picking.examine:
        sizes["finish_slice"] = finish_slice_bytes(scan.pairs // scan.slices)
        sizes["write_picked"] = join_slices_bytes(scan.pairs)
    return sizes | {name: sum(parts.values()) for name, parts in ray_task_parts(scan, settings).items()}


def ray_task_parts(scan: Summary, settings: Settings) -> dict[str, dict[str, int]]:
    """Memory of the tasks that trace rays or use them, by what takes it, bytes.

    Args:
        scan, settings: as for ``call_bytes``.
    """
    shape, rays = shape_of(scan, settings), rays_of(scan, settings)
    image, field = REAL * math.prod(shape), _field_of_task(scan, settings)
    problems = 1 if settings.decomposition == "volume" else scan.slices
    # A process caches times and losses of the dataset, and those of recent problems.
    kept = min(PROBLEMS_KEPT, problems * (settings.numerics.coarser_grids + 1))
    data = 3 * REAL * scan.pairs + kept * 3 * REAL * emitters_of(scan, settings) * scan.receivers
    # Before and after the task, and as the message between worker and service.
    state = FLOOR_BYTES + 3 * state_bytes(shape, settings)

    def tracing(rows: int) -> dict[str, int]:
        share = min(BATCH, emitters_of(scan, settings)) / max(1, emitters_of(scan, settings))
        # The rows of each emitter, and their concatenation.
        entries = 2 * rows_bytes(scan, settings, math.ceil(share * rows))
        return {"data": data, "images": state + image, "a travel time": field, "rays": entries}

    def solving(rows: int) -> dict[str, int]:
        # For each row its time, residual, Huber weight and their product.
        entries = math.ceil(rows * _entries(settings, scan.in_space) * ENTRY_BYTES) + 5 * REAL * rows
        return {"data": data, "images": state + (8 + 8 * len(shape)) * image, "rays": entries}

    parts: dict[str, dict[str, int]] = {}
    if settings.method == "gauss-newton":
        parts["trace_rays"] = tracing(rays)
        parts["update_gauss_newton"] = solving(rays)
        held = min(RAYS_OF_SLICE * problems, RAYS_OF_SLICES)
        parts["update_gauss_newton"]["rays"] = math.ceil(held * parts["update_gauss_newton"]["rays"])
    elif sart_engine(settings, len(shape)) == "opencl":
        parts["update_sart_slices"] = _parts_together(scan, settings, data)
    elif settings.numerics.blocks > 1:
        divided = block_task_parts(shape, scan.receivers, settings)
        parts |= {name: {"data": FLOOR_BYTES, **sizes} for name, sizes in divided.items()}
    elif solver_of(settings, len(shape)).compiled:
        parts["update_sart"] = {
            # ``bentray bench sizing`` measured six arrays of times more than those that are kept.
            "data": data + 6 * REAL * scan.pairs,
            "images": state,
            "a travel time": _pass_bytes(shape, scan.receivers),
        }
    else:
        parts["update_sart"] = {"data": data, "images": state + 8 * image, "a travel time": field}
    if settings.attenuation.enabled and scan.amplitudes:
        parts["trace_attenuation_rays"] = tracing(rays)
        parts["solve_attenuation"] = solving(rays)
    if settings.resolution_check:
        parts["trace_final_rays"] = tracing(rays)
        parts["check_resolution"] = solving(rays)
    if settings.estimates_uncertainty:
        bent, once = settings.changed(rays="curved"), rays
        if settings.numerics.reciprocity and settings.method != "gauss-newton":
            once = -(-rays // 2)
        probes = (PROBE_ARRAYS + 1) * LANES
        # For each row its errors in all probes, weighted too.
        errors = {"probes": probes * image, "errors": (3 * LANES + 8) * REAL * once}
        entries = math.ceil(once * _entries(bent, scan.in_space) * ENTRY_BYTES)
        parts["trace_uncertainty_rays"] = {**tracing(once), "a travel time": _field_of_task(scan, bent)}
        parts["estimate_uncertainty"] = {"data": data, "images": state, "rays": entries, **errors}
    return parts


def slice_bytes(scan: Summary, settings: Settings) -> int:
    """Device memory of one slice that is updated by SART."""
    nodes = settings.grid_nodes
    return SliceSize((nodes, nodes), scan.emitters, scan.receivers, 1, settings.numerics.subset).bytes


def _parts_together(scan: Summary, settings: Settings, data: int) -> dict[str, int]:
    """Memory of all slices updated in one task on a device, by what takes it, bytes."""
    nodes, slices = settings.grid_nodes, scan.slices
    emitters, receivers = scan.emitters, scan.receivers
    # Of each slice the problem with its times and losses, the state before and after, and their copies for
    # the device.
    images = FLOOR_BYTES + slices * 3 * state_bytes((nodes, nodes), settings)
    times = slices * 3 * REAL * emitters * receivers
    # A processor as a device has its arrays in the memory of the worker; a GPU has its own.
    in_flight = min(slices, PROCESSOR_SLICES) * slice_bytes(scan, settings)
    return {"data": data + times, "images": images, "slices on the device": in_flight}


def _field_of_task(scan: Summary, settings: Settings) -> int:
    """Memory of the travel time of one emitter, in the slab where it is tracked, bytes."""
    tracked = shape_of(scan, settings)
    if settings.rays == "straight":
        return 2 * REAL * math.prod(tracked)
    return field_bytes(tracked, settings.ray_eikonal)


def _pass_bytes(shape: tuple[int, ...], receivers: int) -> int:
    """Memory of ``emitter_pass.EmitterPass``: sheets, rays in lockstep, fields; float32."""
    steps = LONGEST * sum(shape)
    return MIB + 4 * (8 * Diagonals.from_shape(shape).size + 3 * steps * receivers + 12 * math.prod(shape))
