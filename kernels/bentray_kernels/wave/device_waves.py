"""A medium and its receivers on an OpenCL device, and how many emitters it has in batch."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise, product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..opencl.program import Program
from .device_grid import ROWS, DeviceGrid, Gather, Group
from .device_memory import ShotPlan, ShotSize
from .medium import Medium
from .points import REACH, Points
from .simulation import Unknown
from .stencil import HALO, weights
from .time_step import FLUSH

if TYPE_CHECKING:
    from ..opencl.session import Session

# Work-items of a group. A processor runs a group in one thread, which turns rows into vectors; of these
# widths the one is taken that fills up least.
PROCESSOR_GROUPS: tuple[Group, ...] = ((64, 1), (32, 1), (16, 1))
OTHER_GROUP: Group = (32, 4)

# Most emitters in flight on a processor: its caches hold the fields of one per core, and its memory is the
# host's.
PROCESSOR_EMITTERS = 4

# Part of the device's memory that the arrays of the emitters in flight may take.
MEMORY_SHARE = 0.5

# Work-items, and those of a group; None: the driver's choice.
Launch = tuple[tuple[int, ...], tuple[int, ...] | None]

# What a step stores, as ``STORE`` of the program.
NOTHING = 0
STORES: dict[Unknown, int] = {"speed": 1, "attenuation": 2}


class Scan(NamedTuple):
    """Properties that all emissions have in common.

    Attributes:
        receivers: on the medium's grid.
        steps: of the time loop.
        every: steps between stored fields; 0: none is stored.
        by: the variable whose change scatters.
    """

    receivers: Points
    steps: int
    every: int = 0
    by: Unknown = "speed"

    @property
    def slots(self) -> int:
        """Stored fields of an emitter."""
        return -(-self.steps // self.every) if self.every else 0

    @property
    def store(self) -> int:
        """The field that a step stores, if it does."""
        return STORES[self.by] if self.every else NOTHING


class DeviceWaves:
    """A medium and its receivers on a device.

    Args:
        session: the device.
        medium: 2-D or 3-D.
        scan: what all emissions have in common.
        group: work-items of a group; None: by the kind of the device.

    Attributes:
        session, scan: the arguments.
        grid: of the medium.
        kind: type of all numbers.
        drive: buffer of that factor of the medium.
        gather: buffers of the receivers' taps by node; None where nothing is stored.
        gathered: nodes with a tap.
    """

    def __init__(self, session: Session, medium: Medium, scan: Scan, group: Group | None = None) -> None:
        self.session, self.scan, self.kind = session, scan, medium.keep.dtype
        self.grid = DeviceGrid.from_medium(medium, group or _group(session, medium))
        self._fills = self.grid.group[1] > 1
        self._factors = [session.upload(self.grid.packed(factor)) for factor in medium.factors]
        self._taps = session.upload(weights(medium.order).astype(self.kind))
        self._receivers = self.uploaded(scan.receivers)
        self.drive, self.gather, self.gathered = self._factors[2], None, 0
        if scan.every:
            gather = Gather.from_receivers(self.grid, scan.receivers)
            self.gather = [session.upload(array) for array in vars(gather).values()]
            self.gathered = len(gather.node)

    @property
    def size(self) -> ShotSize:
        """Numbers of an emitter's arrays."""
        samples = self.scan.steps * len(self.scan.receivers.first)
        image = self.grid.rows * self.grid.shape[-1]
        return ShotSize(self.grid.plane, image, self.scan.slots, samples, self.kind.itemsize)

    def plan(self, memory_bytes: float = math.inf) -> ShotPlan:
        """How many emitters are in batch.

        Args:
            memory_bytes: limit beside that of the device.

        Raises:
            InvalidInput: where one emitter does not fit, naming the bytes of both.
        """
        handle = self.session.handle
        limit = min(memory_bytes, MEMORY_SHARE * handle.global_mem_size)
        plan = ShotPlan.for_memory(self.size, limit, handle.max_mem_alloc_size)
        if not _is_processor(handle):
            return plan
        return plan._replace(emitters=min(plan.emitters, handle.max_compute_units, PROCESSOR_EMITTERS))

    def over_the_image(self, emitters: int) -> Launch:
        """Work-items, and those of a group, of launches over the nodes of the image."""
        width, rows = self.grid.shape[-1], self.grid.rows
        if not self._fills:
            return (width, rows, emitters), None
        across, along = self.grid.group
        return (filled(width, across), filled(rows, along), emitters), (across, along, 1)

    def uploaded(self, elements: Points) -> tuple[Any, Any]:
        """Buffers with the corners and the weights of elements."""
        along = np.ascontiguousarray(elements.weights, self.kind)
        return self.session.upload(elements.first.astype(np.uint32)), self.session.upload(along)

    def advance(self, now: Any, new: Any) -> Any:
        """The kernel of a step from ``now``: the field before it, in ``new``, becomes the one after it."""
        layout = (np.uint32(self.grid.first), *self._strides, np.uint32(self.grid.blocks))
        return self._kernel("advance", NOTHING, *self._stepping(now, new), *layout)

    def scatter(self, now: Any, before: Any, stored: Any) -> Any:
        """The kernel that stores what a change of the medium would scatter in the step from ``now``."""
        layout = (np.uint32(self.grid.shift), *self._strides, self.grid.nodes, stored, np.uint32(0))
        return self._kernel("scatter", self.scan.store, *self._stepping(now, before), *layout)

    def _stepping(self, now: Any, before: Any) -> tuple[Any, ...]:
        return now, before, *self._factors, self._taps, self.kind.type(FLUSH)

    def exchange(self, store: int, now: Any, new: Any, stored: Any, *points: Any, reading: bool) -> Any:
        """The kernel that ends a step forwards.

        Args:
            store: what a step stores.
            now, new: fields before and after the step.
            stored: buffer.
            points: buffers of traces, emitters and wavelet.
            reading: whether receivers read, too.
        """
        traces, *emitters = points
        receivers = len(self.scan.receivers.first) if reading else 0
        sizes = uints(self.scan.steps, receivers, self.grid.shift)
        layout = (*self._strides, self.grid.nodes, stored, *uints(0, 0))
        return self._kernel(
            "exchange", store, now, new, self.drive, *self._receivers, traces, *emitters, *sizes, *layout
        )

    def correlate(self, now: Any, stored: Any, image: Any, light: Any) -> Any:
        """The kernel that correlates the adjoint field ``now`` with a stored one."""
        layout = (np.uint32(self.grid.shift), *self._strides, self.grid.nodes, *uints(0, 0))
        return self._kernel("correlate", NOTHING, now, stored, image, light, *layout)

    def inject(self, new: Any, residual: Any) -> Any:
        """The kernel that ends a step backwards."""
        assert self.gather is not None
        sizes = uints(self.scan.steps, len(self.scan.receivers.first))
        numbers = (np.uint64(self.grid.plane), *uints(self.gathered, 0))
        return self._kernel("inject", NOTHING, new, self.drive, *self.gather, residual, *sizes, *numbers)

    @property
    def _strides(self) -> tuple[Any, ...]:
        return *uints(self.grid.pitch, self.grid.slab), np.uint64(self.grid.plane)

    def misfit(self, name: str, *arguments: Any) -> Any:
        """A kernel of ``misfits.cl`` with its arguments."""
        return self._own_kernel(_misfits(self.kind), name, arguments)

    def _kernel(self, name: str, store: int, *arguments: Any) -> Any:
        program = _waves(self.kind, len(self.grid.shape), store, self._fills)
        return self._own_kernel(program, name, arguments)

    def _own_kernel(self, program: Program, name: str, arguments: tuple[Any, ...]) -> Any:
        from ..opencl.session import set_arguments

        kernel = self.session.own_kernel(program, name)
        set_arguments(kernel, *arguments)
        return kernel


def programs() -> Iterator[Program]:
    """The programs in both precisions and dimensions, for all that a step stores."""
    for kind in (np.dtype(np.float32), np.dtype(np.float64)):
        yield _misfits(kind)
        for ndim, store, fills in product((2, 3), (NOTHING, *STORES.values()), (False, True)):
            yield _waves(kind, ndim, store, fills)


def _misfits(kind: np.dtype[Any]) -> Program:
    return Program(("wave/misfits",), (_real(kind),))


def _waves(kind: np.dtype[Any], ndim: int, store: int, fills: bool) -> Program:
    sizes = {
        "DIMS": ndim,
        "HALO": HALO,
        "TAPS": 2 * REACH,
        "ROWS": ROWS,
        "STORE": store,
        "FILLED": int(fills),
    }
    return Program(("wave/waves",), (_real(kind), *(f"{key}={value}" for key, value in sizes.items())))


def _real(kind: np.dtype[Any]) -> str:
    return "REAL=" + ("float" if kind == np.float32 else "double")


def tiles(emitters: int, most: int) -> Iterator[slice]:
    """Emitters in tiles of nearly equal size, at most ``most``."""
    number = -(-emitters // most)
    edges = [emitters * k // number for k in range(number + 1)] if number else []
    return (slice(begin, end) for begin, end in pairwise(edges))


def filled(number: int, group: int) -> int:
    """Work-items filled up to whole groups."""
    return -(-number // group) * group


def uints(*values: int) -> tuple[np.uint32, ...]:
    """Numbers as kernels take them."""
    return tuple(np.uint32(value) for value in values)


def _group(session: Session, medium: Medium) -> Group:
    if not _is_processor(session.handle):
        return OTHER_GROUP
    return min(PROCESSOR_GROUPS, key=lambda group: DeviceGrid.from_medium(medium, group).filled[-1])


def _is_processor(handle: Any) -> bool:
    import pyopencl as cl

    return bool(handle.type & cl.device_type.CPU)
