"""Plan of a reconstruction: tasks and memory, computed before it starts and checked against the workers."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import WIDTH_M
from bentray_kernels.tomography.directivity import check_normals
from bentray_kernels.tomography.model_selection.finite_frequency_candidates import WIDE
from bentray_kernels.tomography.model_selection.selection import (
    CANDIDATES,
    candidate_settings,
    final_settings,
    label,
)
from bentray_kernels.tomography.reflection.reflection_plan import check_reflection
from bentray_kernels.tomography.requirements import check_waveform
from bentray_kernels.tomography.sart.device_slices import MEMORY_SHARE
from bentray_kernels.tomography.settings import MIN_NODES, Settings
from bentray_kernels.tomography.solver_choice import sart_engine, undivided_reason
from bentray_kernels.tomography.stage_graphs import BATCH

from ..cluster.capacities import MIB, REAL, Lane, WorkerCapacity, resource_of, without_device
from ..cluster.checkpoints import KEPT
from ..cluster.task_costs import Sizes, TaskPlan, bytes_of, largest_of, largest_sizes
from ..cluster.task_words import task_in_words
from ..files.dataset.counts import Summary
from ..files.dataset.read import PAIR_ARRAYS
from ..files.quantities import IMAGES
from .blocks.block_choice import fitting_blocks
from .ray_sizes import (
    block_files_bytes,
    emitters_of,
    front_bytes,
    problems_of,
    ray_task_sizes,
    rows_bytes,
    shape_of,
    slice_bytes,
    state_bytes,
)
from .reconstruction_cost import reconstruction_cost
from .trace_sizes import (
    picking_task_sizes,
    picking_tasks,
    reflection_bytes,
    reflection_task_sizes,
    reflection_tasks,
)
from .waveform_memory import budgeted, least_batch_bytes, wave_task_bytes, wave_tasks

Decomposition = Literal["slices", "emitters", "volume"]

# Size of a result or a checkpoint without its images.
RECORD_BYTES = 64 * 2**10

# Nodes crossed by rays in half a second of SART on a core of 2020; for the estimated number of tasks.
NODES_IN_A_TASK = 1.5e7

# The setting to change where a task takes too much memory; of others ``nodes``.
FIELDS: Mapping[str, str] = MappingProxyType(
    {
        "validate_image": "method",
        **dict.fromkeys(("start_band", "evaluate_emitter", "update_image"), "minutes"),
        **dict.fromkeys(("solve_element_times", "measure_scan_pulse", "sum_emissions"), "reflection"),
    }
)

# Tasks about a block for each emitter: some sweeps, its rays, their back-projection, and the update.
BLOCK_TASKS = 6


@dataclass(frozen=True, kw_only=True)
class Plan(TaskPlan):
    """Tasks of a reconstruction and their memory.

    Attributes:
        decomposition: ``slices`` in parallel; ``emitters`` of each slice in parallel; a ``volume``.
        lane: see ``capacities.Lane``.
        tasks: estimated number of tasks.
        field_bytes, rows_bytes, state_bytes: of a travel time; of all rays of an image; of the state between
            two tasks.
        stored_bytes: largest disk space of result and checkpoints.
        blocks: of planes, into which a volume is cut because its arrays fit no worker; 1: whole.
        nodes: along each side of the image.
        methods: the method and rays, or the candidates of auto, in words.
        work_class, work_s, speed_known: see ``reconstruction_cost.ReconstructionCost``.
    """

    field_bytes: int
    rows_bytes: int
    state_bytes: int
    stored_bytes: int
    blocks: int
    nodes: int
    methods: list[str]
    work_class: str
    work_s: float
    speed_known: bool


def plan(scan: Summary, settings: Settings, capacities: Sequence[WorkerCapacity]) -> Plan:
    """The plan of a reconstruction on the workers that are connected now.

    Args:
        scan: the dataset.
        settings: see ``Settings``.
        capacities: of the connected workers; without any, no limit is checked.

    Raises:
        InvalidInput: for a resource that no connected worker has, for a task that none can run (``nodes``
            with the bytes found and accepted), for an opening angle without directions of the elements, and
            for an array without width, stored by earlier versions.
    """
    _check_extent(scan)
    check_normals(settings.opening_angle_deg, normals=scan.normals)
    settings = settings.changed(
        decomposition=settings.decomposition or scan.decomposition, nodes=settings.nodes or scan.nodes
    )
    lane: Lane = "opencl" if resource_of(settings) == "opencl" else "recon"
    fitting = [one for one in capacities if lane in one.resources]
    if capacities and not fitting:
        raise without_device(settings)
    settings = settings.changed(blocks=fitting_blocks(scan, settings, fitting))
    methods = _final_settings(settings)
    if settings.method == "waveform":
        samples = 0 if scan.traces is None else scan.traces.samples
        check_waveform(settings, samples, scan.slices, in_space=scan.in_space)
    check_reflection(settings, traces=scan.echoes is not None, in_space=scan.in_space)
    # Candidates of 3-D arrays are validated by times alone.
    traces = None if scan.in_space and settings.method == "auto" else scan.traces
    refining = budgeted(traces, scan.width_m, scan.slices, settings)
    calls = bytes_of(task_sizes(scan, settings)) | wave_task_bytes(traces, scan.width_m, refining)
    _check_device(scan, methods, least_batch_bytes(traces, scan.width_m, refining), fitting)
    limit = max((one.task_bytes for one in fitting), default=math.inf)
    name, largest = largest_of(calls)
    if largest > limit:
        field = FIELDS.get(name, "nodes")
        given = field == "reflection" or getattr(settings, field)
        raise InvalidInput(
            field,
            f"{given}, for which a task ({task_in_words(name)}) takes {largest} bytes"
            + _largest_term(scan, methods, name),
            f"settings whose tasks take at most {limit:.0f} bytes" + _advice(scan, settings, limit),
        )
    able = [one for one in fitting if one.task_bytes >= largest]
    shape = shape_of(scan, settings)
    decomposition = _decomposition(settings)
    tasks = sum(_tasks(scan, method, shape) for method in methods)
    tasks += scan.slices * wave_tasks(traces, scan.width_m, refining) + reflection_tasks(scan, settings)
    if scan.traces_bytes:
        tasks += picking_tasks(scan.recorded, scan.slices, settings)
    cost = reconstruction_cost(scan, settings, len(able))
    return Plan(
        decomposition=decomposition,
        lane=lane,
        tasks=tasks,
        workers=len(able),
        call_bytes=calls,
        field_bytes=max(front_bytes(shape, method.ray_eikonal) for method in methods),
        rows_bytes=max(rows_bytes(scan, method) for method in methods),
        state_bytes=state_bytes(shape, settings),
        stored_bytes=_stored_bytes(scan, settings, shape),
        blocks=settings.numerics.blocks,
        nodes=settings.grid_nodes,
        methods=_methods(settings),
        work_class=cost.work_class,
        work_s=cost.seconds,
        speed_known=cost.speed_known,
        why=_why(scan, settings, decomposition, lane, tasks, (name, largest), capacities, able),
    )


def task_sizes(scan: Summary, settings: Settings) -> Sizes:
    """What determines the memory of each task, by its name; see ``waveform_memory`` for those of waves.

    Args:
        scan: the dataset.
        settings: with nodes and decomposition.
    """
    methods = _final_settings(settings)
    return {
        **largest_sizes(picking_task_sizes(scan, method) for method in methods),
        **largest_sizes(ray_task_sizes(scan, method) for method in methods),
        **reflection_task_sizes(scan, settings),
    }


def _final_settings(settings: Settings) -> list[Settings]:
    """The settings, or those with which auto ends after each of its candidates."""
    if not settings.selects_model:
        return [settings]
    return [final_settings(settings, changes) for changes in CANDIDATES]


def _check_extent(scan: Summary) -> None:
    WIDTH_M.check("geometry/element_position_m", scan.width_m)
    if not scan.height_m <= WIDTH_M.most:
        raise InvalidInput("slice/z_m", f"slices over {scan.height_m:.4g} m", f"at most {WIDTH_M.most:g} m")


def _check_device(
    scan: Summary, methods: Sequence[Settings], waves: int, workers: Sequence[WorkerCapacity]
) -> None:
    """Check that a device can hold one slice, or one emitter of ``waves`` bytes; more of them are tiled.

    Raises:
        InvalidInput: with the bytes of both.
    """
    able = [one for one in methods if sart_engine(one, 3 if one.decomposition == "volume" else 2) == "opencl"]
    slices = max((slice_bytes(scan, one) for one in able), default=0)
    needed = max(slices, waves)
    # Of a device whose memory is unknown nothing is expected.
    limits = [MEMORY_SHARE * one.device_bytes if one.device_bytes else math.inf for one in workers]
    if not needed or not limits or needed <= max(limits):
        return
    what, field = ("a slice", "nodes") if slices >= waves else ("an emitter", "method")
    found = methods[0].grid_nodes if field == "nodes" else "'waveform'"
    raise InvalidInput(
        field,
        f"{found}, for which {what} takes {needed} bytes on the device",
        f"at most {max(limits):.0f} bytes, half of the memory of the largest device; or device cpu",
    )


def _decomposition(settings: Settings) -> Decomposition:
    if settings.decomposition == "volume":
        return "volume"
    return "slices" if settings.method == "sart" else "emitters"


def _methods(settings: Settings) -> list[str]:
    """The candidates of auto with the requested rays, or the one method, in words."""
    if not settings.selects_model:
        return [label({"rays": settings.rays, "method": settings.method})]
    tried = [one for one in CANDIDATES if settings.rays == "curved" or one["rays"] == "straight"]
    return list(dict.fromkeys(label(one) for one in tried))


def _tasks(scan: Summary, settings: Settings, shape: tuple[int, ...]) -> int:
    """Estimated number of tasks, with stages on coarser grids."""
    problems, emitters = problems_of(scan, settings), emitters_of(scan, settings)
    parts = -(-emitters // BATCH)
    passes = settings.iterations * (settings.numerics.coarser_grids + 1)
    if settings.numerics.blocks > 1:
        return passes * emitters * BLOCK_TASKS * settings.numerics.blocks + 1
    if settings.method == "gauss-newton":
        each = passes * (parts + 1)
    else:
        batch = max(1.0, NODES_IN_A_TASK / (math.prod(shape) * 2.0 + scan.receivers * settings.grid_nodes))
        each = passes * math.ceil(emitters / batch)
    further = bool(settings.attenuation.enabled and scan.amplitudes) + settings.resolution_check
    each += (parts + 1) * (further + settings.estimates_uncertainty)
    return problems * each + 1


def _stored_bytes(scan: Summary, settings: Settings, shape: tuple[int, ...]) -> int:
    """Without compression: all images of the result, checkpoints, and picked times."""
    picked = len(PAIR_ARRAYS) * REAL * scan.pairs if scan.traces_bytes else 0
    each = len(IMAGES) * REAL * math.prod(shape) + KEPT * state_bytes(shape, settings) + RECORD_BYTES
    each += reflection_bytes(scan, settings)
    each += block_files_bytes(shape) if settings.numerics.blocks > 1 else 0
    return problems_of(scan, settings) * each + picked + _trials_bytes(scan, settings)


def _trials_bytes(scan: Summary, settings: Settings) -> int:
    """Checkpoints of all candidates of auto, which stay until the end of the job."""
    if not settings.selects_model:
        return 0
    plans = candidate_settings(settings, (*CANDIDATES, *WIDE))
    return sum(KEPT * state_bytes(shape_of(scan, one), one) + RECORD_BYTES for one in plans)


def _largest_term(scan: Summary, methods: Sequence[Settings], name: str) -> str:
    """What takes most memory of a task that uses rays, in words; empty for other tasks."""
    rays = largest_sizes(ray_task_sizes(scan, method) for method in methods)
    if name not in rays:
        return ""
    term, most = largest_of(rays[name].terms)
    return f", {most} of them for {term.partition(',')[0]}"


def _advice(scan: Summary, settings: Settings, limit: float) -> str:
    """The largest grid that fits, in words; empty without one."""

    def fits(nodes: int) -> bool:
        smaller = settings.changed(nodes=nodes, coarser_grids=0)
        sizes = picking_task_sizes(scan, smaller) | ray_task_sizes(scan, smaller)
        return largest_of(bytes_of(sizes))[1] <= limit

    if settings.selects_model or not fits(MIN_NODES):
        return _blocks_advice(scan, settings)
    low, high = MIN_NODES, settings.grid_nodes
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    return f", such as nodes up to {low}, or a worker with more memory{_blocks_advice(scan, settings)}"


def _blocks_advice(scan: Summary, settings: Settings) -> str:
    """What keeps a volume from being computed in blocks, in words."""
    reason = undivided_reason(settings, amplitudes=scan.amplitudes)
    if settings.decomposition != "volume" or not reason:
        return ""
    return f"; method sart can compute a volume in blocks, but not with {reason}"


def _in_blocks(settings: Settings) -> str:
    """That a volume is cut into blocks, in words."""
    blocks = settings.numerics.blocks
    if blocks == 1:
        return ""
    solver = " with times by fast sweeping" if settings.rays == "curved" else ""
    return f", in {blocks} blocks{solver}, since the arrays of the whole volume fit no worker"


def _why(
    scan: Summary,
    settings: Settings,
    decomposition: Decomposition,
    lane: Lane,
    tasks: int,
    largest: tuple[str, int],
    capacities: Sequence[WorkerCapacity],
    able: Sequence[WorkerCapacity],
) -> str:
    slices = f"{scan.slices} slices" if scan.slices > 1 else "one slice"
    each = f"each of {scan.slices} slices" if scan.slices > 1 else "the slice"
    cut: dict[Decomposition, Callable[[], str]] = {
        "slices": lambda: f"{slices} in parallel; SART uses the emitters of a slice one after the other",
        "emitters": lambda: f"the {scan.emitters} emitters of {each} in parallel",
        "volume": lambda: (
            f"one volume of {emitters_of(scan, settings)} emitters"
            + (" one after the other (SART)" if settings.method == "sart" else " in parallel")
            + _in_blocks(settings)
        ),
    }
    name, size = largest
    if not capacities:
        who = "no worker is connected yet"
    else:
        limits = [one.task_bytes for one in able]
        memory = "no limit" if math.isinf(max(limits)) else f"up to {max(limits) / MIB:.0f} MiB"
        who = f"{len(able)} of {len(capacities)} workers can run it ({memory})"
    where = " on OpenCL devices" if lane == "opencl" else ""
    what = cut[decomposition]()
    return (
        f"{what[0].upper()}{what[1:]}{where}, in about {tasks} tasks; the largest "
        f"({task_in_words(name)}) takes {size / MIB:.0f} MiB, and {who}."
    )
