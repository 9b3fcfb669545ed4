"""What determines the memory of the tasks that trace rays or use them, and of SART in blocks."""

import math

from bentray_kernels.rays.block_tracing import ABOVE, BELOW, GUARD
from bentray_kernels.tomography.problem import MARGIN_NODES
from bentray_kernels.tomography.sart.device_slices import PROCESSOR_SLICES, SliceSize
from bentray_kernels.tomography.sart.sart_update import smoothing_reach
from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.solver_choice import sart_engine, solver_of

from ..cluster.capacities import REAL
from ..cluster.task_costs import Sizes, TaskSize
from ..files.dataset.counts import Summary

# Problems that a process keeps, of slices and stages.
PROBLEMS_KEPT = 8


def shape_of(scan: Summary, settings: Settings) -> tuple[int, ...]:
    """Shape of an image, as ``Problem.from_dataset`` makes it."""
    nodes = settings.grid_nodes
    if settings.decomposition != "volume":
        return nodes, nodes
    side = settings.side_m or scan.width_m * (nodes - 1) / (nodes - 1 - 2 * MARGIN_NODES)
    heights = math.ceil(scan.height_m * (nodes - 1) / side) + 1 + 2 * MARGIN_NODES
    return nodes, nodes, heights


def problems_of(scan: Summary, settings: Settings) -> int:
    """Number of images: one for each slice, or one volume."""
    return 1 if settings.decomposition == "volume" else scan.slices


def emitters_of(scan: Summary, settings: Settings) -> int:
    """Number of emitters of one problem."""
    return scan.emitters * (scan.slices if settings.decomposition == "volume" else 1)


def _rays_of(scan: Summary, settings: Settings) -> int:
    """Number of rays of one problem that are held at the same time."""
    rays = emitters_of(scan, settings) * scan.receivers
    # Elements that only receive are emitters too, of the reverse pairs.
    recorded = -(-scan.pairs // problems_of(scan, settings))
    if settings.method == "gauss-newton" and settings.numerics.reciprocity:
        return min(-(-rays // 2), recorded)
    return min(rays, 2 * recorded)


def _nodes_along(scan: Summary, settings: Settings) -> int:
    """Nodes along a ray; one in space passes twice as many as a level one."""
    level = settings.decomposition != "volume" or (settings.rays == "straight" and not scan.in_space)
    return settings.grid_nodes * (1 if level else 2)


def state_bytes(shape: tuple[int, ...], settings: Settings) -> int:
    """Slowness and coverage; with Gauss–Newton the best image, the start and the dual too."""
    images = 2 if settings.method == "sart" else 4 + len(shape)
    return images * REAL * math.prod(shape)


def front_bytes(shape: tuple[int, ...], method: str) -> int:
    """Memory of one travel time with the data for ray tracing, by one of ``eikonal.methods()``."""
    return TaskSize(_tracing(shape), _front(shape, method)).bytes


def rows_bytes(scan: Summary, settings: Settings) -> int:
    """Memory of all rays of an image."""
    rays = {"rays": _rays_of(scan, settings) * _nodes_along(scan, settings)}
    return TaskSize(_tracing(shape_of(scan, settings)), rays).terms["rays"]


def _tracing(shape: tuple[int, ...]) -> str:
    return f"trace_rays, {len(shape)}-D"


def _front(shape: tuple[int, ...], method: str) -> dict[str, float]:
    return {f"a travel time, {method}": math.prod(shape)}


def slice_bytes(scan: Summary, settings: Settings) -> int:
    """Device memory of one slice that is updated by SART."""
    nodes = settings.grid_nodes
    return SliceSize((nodes, nodes), scan.emitters, scan.receivers, 1, settings.numerics.subset).bytes


def ray_task_sizes(scan: Summary, settings: Settings) -> Sizes:
    """Sizes of the tasks of one method, never ``method`` auto, by the name of the task."""
    shape, rays = shape_of(scan, settings), _rays_of(scan, settings)
    nodes, emitters, problems = math.prod(shape), emitters_of(scan, settings), problems_of(scan, settings)
    # A process caches times and losses of the dataset, and those of recent problems.
    kept = min(PROBLEMS_KEPT, problems * (settings.numerics.coarser_grids + 1))
    data = {"data": scan.pairs + kept * emitters * scan.receivers, "images": nodes}

    def front(solver: Settings) -> dict[str, float]:
        return {} if solver.rays == "straight" else _front(shape, solver.ray_eikonal)

    def tracing(solver: Settings) -> TaskSize:
        # The rays of all emitters stay in the worker until they are used.
        held = {"rays": rays * _nodes_along(scan, solver)}
        return TaskSize(_tracing(shape), {**data, **front(solver), **held})

    held = {**data, "rays": rays * _nodes_along(scan, settings)}
    solving = TaskSize(f"solve_rays, {len(shape)}-D", held)
    sizes: Sizes = {}
    if settings.method == "gauss-newton":
        # While one slice is updated, rays of others are traced already.
        others = {"rays of other slices": held["rays"] if problems > 1 else 0}
        sizes["trace_rays"] = tracing(settings)
        sizes["update_gauss_newton"] = solving._replace(counts={**held, **others})
    elif sart_engine(settings, len(shape)) == "opencl":
        counts = {
            "data": scan.pairs + scan.slices * emitters * scan.receivers,
            "images": scan.slices * nodes,
            # A processor as a device has its arrays in the memory of the worker; a GPU has its own.
            "slices on the device": min(scan.slices, PROCESSOR_SLICES) * slice_bytes(scan, settings),
        }
        sizes["update_sart_slices"] = TaskSize("update_sart_slices", counts)
    elif settings.numerics.blocks > 1:
        sizes |= _block_task_sizes(scan, settings, shape)
    elif solver_of(settings, len(shape)).compiled:
        sizes["update_sart"] = TaskSize("update_sart", {**data, "rays": sum(shape) * scan.receivers})
    else:
        kind = f"update_sart by each emitter, {len(shape)}-D"
        sizes["update_sart"] = TaskSize(kind, {**data, **front(settings)})
    if settings.attenuation.enabled and scan.amplitudes:
        sizes["trace_attenuation_rays"] = tracing(settings)
        # Validation copies the rays of training and of held-out pairs.
        sizes["solve_attenuation"] = solving._replace(counts={**held, "rays": 2 * held["rays"]})
    if settings.resolution_check:
        sizes["trace_final_rays"] = tracing(settings)
        sizes["check_resolution"] = solving
    if settings.estimates_uncertainty:
        bent = settings.changed(rays="curved")
        sizes["trace_uncertainty_rays"] = tracing(bent)
        sizes["estimate_uncertainty"] = TaskSize(
            "estimate_uncertainty", {"images": nodes, "rays": rays * _nodes_along(scan, bent)}
        )
    return sizes


def _block_task_sizes(scan: Summary, settings: Settings, shape: tuple[int, ...]) -> Sizes:
    """Of tasks of SART in blocks of planes."""
    plane, own = math.prod(shape[1:]), -(-shape[0] // min(settings.numerics.blocks, shape[0]))
    near = plane * min(own + BELOW + ABOVE + 2 * GUARD, shape[0])
    smooth = plane * min(own + 2 * smoothing_reach(settings), shape[0])
    points = {"points of rays": scan.receivers * max(shape)}
    # For curved rays T, T² and its gradient too.
    traced = "curved rays in a block" if settings.rays == "curved" else "a block"
    sizes = {
        "trace_rays_in_block": {traced: near, **points},
        "back_project_in_block": {"a block": near, **points},
        "update_block": {"a block": smooth},
    }
    if settings.rays == "curved":
        sizes["sweep_block"] = {"a block": own * plane}
    return {name: TaskSize(name, counts) for name, counts in sizes.items()}


def block_files_bytes(shape: tuple[int, ...]) -> int:
    """Disk space of the files of all blocks during a reconstruction, without the points of rays.

    Arrays of the size of the volume: times before and after, sums, and three states of two images.
    """
    return (2 + 2 + 3 * 2) * REAL * math.prod(shape)
