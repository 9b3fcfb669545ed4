"""What a reconstruction will take of its workers, computed before it starts, and whether they have it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from bentray_kernels.errors import InvalidInput
from bentray_kernels.limits import WIDTH_M
from bentray_kernels.tomography.model_selection.selection import CANDIDATES
from bentray_kernels.tomography.settings import LEAST_NODES, Settings
from bentray_kernels.tomography.stage_graphs import BATCH

from ..cluster.capacities import MIB, REAL, Lane, WorkerCapacity, resource_of
from ..cluster.checkpoints import KEPT
from ..files.dataset.counts import Summary
from ..files.dataset.format import PAIR_ARRAYS
from ..files.reconstruction import IMAGES
from .memory.arrival_memory import arrival_tasks
from .memory.ray_memory import (
    call_bytes,
    emitters_of,
    field_bytes,
    rays_of,
    rows_bytes,
    shape_of,
    state_bytes,
)
from .memory.waveform_memory import budgeted, wave_call_bytes, wave_tasks

Decomposition = Literal["slices", "emitters", "volume"]

# What a result and a checkpoint say beside their images.
RECORD_BYTES = 64 * 2**10

# Nodes that an emitter's rays cross in half a second of SART, on a core of 2020; only tells how many tasks.
NODES_IN_A_TASK = 1.5e7


@dataclass(frozen=True)
class Plan:
    """How a reconstruction is cut into tasks and what the tasks take.

    Attributes:
        decomposition: ``slices`` side by side; ``emitters`` of each slice side by side; a ``volume``.
        lane: which workers take the tasks.
        tasks: about how many there will be.
        workers: how many are connected and can hold each of them.
        call_bytes: of one task, by its name; working arrays, arguments and what
            a process keeps of the dataset.
        field_bytes, rows_bytes, state_bytes: of a travel time while it is made; of all rows of an image; of
            what comes back between two calls.
        stored_bytes: on disk while it runs, at most: the result, and the checkpoints beside it.
        why: all of it in a sentence.
    """

    decomposition: Decomposition
    lane: Lane
    tasks: int
    workers: int
    call_bytes: Mapping[str, int]
    field_bytes: int
    rows_bytes: int
    state_bytes: int
    stored_bytes: int
    why: str

    @property
    def largest(self) -> tuple[str, int]:
        """The call that takes most, and its bytes."""
        return max(self.call_bytes.items(), key=lambda item: item[1])

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {**asdict(self), "call_bytes": dict(self.call_bytes), "largest_bytes": self.largest[1]}


def plan(scan: Summary, settings: Settings, offers: Sequence[WorkerCapacity]) -> Plan:
    """The plan of a reconstruction on the workers that are connected now.

    Args:
        scan: the dataset.
        settings: see ``Settings``; ``decomposition`` and ``eikonal`` override what a plan could choose.
        offers: the connected workers; none says nothing, for some may come.

    Raises:
        InvalidInput: for a lane that no connected worker offers, for a task that none can hold (``nodes``
            with the bytes found and accepted), and for an array of no width, taken in before that was
            refused.
    """
    _check_extent(scan)
    lane: Lane = "opencl" if resource_of(settings) == "opencl" else "recon"
    fitting = [offer for offer in offers if lane in offer.resources]
    if offers and not fitting:
        raise InvalidInput(
            "eikonal", f"{settings.eikonal!r}, which no connected worker offers", "a method without a device"
        )
    ways = [settings]
    if settings.selects_model:
        ways = [settings.changed(**changes) for changes in CANDIDATES]
    calls: dict[str, int] = {}
    for way in ways:
        for name, size in call_bytes(scan, way).items():
            calls[name] = max(size, calls.get(name, 0))
    # Trials of elements in space are judged by times alone.
    heard = None if scan.in_space and settings.method == "auto" else scan.traces
    refining = budgeted(heard, scan.width_m, scan.slices, settings)
    waves = wave_call_bytes(heard, scan.width_m, refining)
    calls |= waves
    room = max((offer.task_bytes for offer in fitting), default=math.inf)
    name, size = max(calls.items(), key=lambda item: item[1])
    if size > room:
        field: str = "nodes" if name not in waves else "method" if name == "judge_by_waves" else "minutes"
        found = getattr(settings, field)
        raise InvalidInput(
            field,
            f"{found}, for which a task ({name}) takes {size} bytes",
            f"settings whose tasks take at most {room:.0f} bytes" + _advice(scan, settings, room),
        )
    able = [offer for offer in fitting if offer.task_bytes >= size]
    shape = shape_of(scan, settings)
    decomposition = _decomposition(settings)
    tasks = sum(_tasks(scan, way, shape) for way in ways)
    tasks += scan.slices * wave_tasks(heard, scan.width_m, refining)
    if scan.traces_bytes:
        tasks = tasks * (1 + settings.numerics.guided_rounds) + arrival_tasks(
            scan.traces, scan.slices, settings
        )
    return Plan(
        decomposition,
        lane,
        tasks,
        len(able),
        calls,
        max(field_bytes(shape, way.ray_eikonal) for way in ways),
        max(rows_bytes(scan, way, rays_of(scan, way)) for way in ways),
        state_bytes(shape, settings),
        _stored_bytes(scan, settings, shape),
        _why(scan, settings, decomposition, lane, tasks, (name, size), offers, able),
    )


def _check_extent(scan: Summary) -> None:
    WIDTH_M.check("geometry/element_position_m", scan.width_m)
    if not scan.height_m <= WIDTH_M.most:
        raise InvalidInput("slice/z_m", f"slices over {scan.height_m:.4g} m", f"at most {WIDTH_M.most:g} m")


def blocks_of(shape: tuple[int, ...], offers: Sequence[WorkerCapacity]) -> tuple[int, ...]:
    """Blocks along each axis for ``reconstruction.subdomains.solve``.

    One where a worker can hold the whole field by ``fsm``, else as few as all workers together can hold, the
    longest sides cut first.

    Raises:
        InvalidInput: where they cannot hold it together.
    """
    rooms = [offer.task_bytes for offer in offers if "recon" in offer.resources]
    if not rooms or max(rooms) >= field_bytes(shape, "fsm"):
        return (1,) * len(shape)
    least, together = min(rooms), len(rooms)
    blocks = [1] * len(shape)
    # A worker keeps slowness, times and one earlier copy of each of its blocks, and sweeps one at a time.
    while True:
        block = tuple(-(-n // b) for n, b in zip(shape, blocks, strict=True))
        kept = 3 * REAL * math.prod(block) * -(-math.prod(blocks) // together)
        if kept + field_bytes(block, "fsm") <= least:
            return tuple(blocks)
        if max(block) <= LEAST_NODES or 3 * REAL * math.prod(shape) > together * least:
            taken = 3 * REAL * math.prod(shape) + field_bytes(block, "fsm")
            raise InvalidInput("speed", f"shape {shape}, {taken} bytes", f"{together * least:.0f} bytes")
        blocks[block.index(max(block))] += 1


def _decomposition(settings: Settings) -> Decomposition:
    if settings.decomposition == "volume":
        return "volume"
    return "slices" if settings.method == "sart" else "emitters"


def _tasks(scan: Summary, settings: Settings, shape: tuple[int, ...]) -> int:
    """About how many calls, the stages on coarser grids included."""
    problems = 1 if settings.decomposition == "volume" else scan.slices
    emitters = emitters_of(scan, settings)
    parts = -(-emitters // BATCH)
    passes = settings.iterations * (settings.numerics.coarser_grids + 1)
    passes += settings.numerics.straight_iterations if settings.rays != "straight" else 0
    if settings.method == "gauss-newton":
        each = passes * (parts + 1)
    else:
        batch = max(1.0, NODES_IN_A_TASK / (math.prod(shape) * 2.0 + scan.receivers * settings.nodes))
        each = passes * math.ceil(emitters / batch)
    each += (parts + 1) * (bool(settings.attenuation.enabled and scan.amplitudes) + settings.resolution_check)
    return problems * each + 1


def _stored_bytes(scan: Summary, settings: Settings, shape: tuple[int, ...]) -> int:
    """As if nothing could be packed: all images of the result, checkpoints, and what is picked in traces."""
    problems = 1 if settings.decomposition == "volume" else scan.slices
    picked = len(PAIR_ARRAYS) * REAL * scan.pairs if scan.traces_bytes else 0
    each = len(IMAGES) * REAL * math.prod(shape) + KEPT * state_bytes(shape, settings) + RECORD_BYTES
    return problems * each + picked


def _advice(scan: Summary, settings: Settings, room: float) -> str:
    """The largest grid that fits, in words; empty where none does."""

    def fits(nodes: int) -> bool:
        return max(call_bytes(scan, settings.changed(nodes=nodes, coarser_grids=0)).values()) <= room

    if settings.selects_model or not fits(LEAST_NODES):
        return ""
    low, high = LEAST_NODES, settings.nodes
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    return f", as nodes up to {low}, or a worker with more memory"


def _why(
    scan: Summary,
    settings: Settings,
    decomposition: Decomposition,
    lane: Lane,
    tasks: int,
    largest: tuple[str, int],
    offers: Sequence[WorkerCapacity],
    able: Sequence[WorkerCapacity],
) -> str:
    slices = f"{scan.slices} slice{'s' if scan.slices > 1 else ''}"
    cut: dict[Decomposition, Callable[[], str]] = {
        "slices": lambda: f"{slices} side by side, for SART uses the emitters of a slice one after the other",
        "emitters": lambda: f"the {scan.emitters} emitters of each of {slices} side by side",
        "volume": lambda: (
            f"one volume, as asked for by decomposition, of {emitters_of(scan, settings)} emitters"
            + (" one after the other (SART)" if settings.method == "sart" else " side by side")
        ),
    }
    name, size = largest
    if not offers:
        who = "no worker is connected yet"
    else:
        limits = [offer.task_bytes for offer in able]
        told = "no limit" if math.isinf(max(limits)) else f"up to {max(limits) / MIB:.0f} MiB"
        who = f"{len(able)} of {len(offers)} workers can hold it ({told})"
    where = " on OpenCL devices" if lane == "opencl" else ""
    what = cut[decomposition]()
    return (
        f"{what[0].upper()}{what[1:]}{where}, in about {tasks} tasks; the largest ({name}) takes "
        f"{size / MIB:.0f} MiB, and {who}."
    )
