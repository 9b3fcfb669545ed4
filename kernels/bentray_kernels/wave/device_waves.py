"""A medium and its receivers on an OpenCL device, and how many emitters it has in batch."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ..opencl.device_scene import REALS
from ..opencl.program import Program
from ..opencl.session import DeviceKernel, Session
from .device_grid import ROWS, DeviceGrid, Gather, Group
from .device_memory import ShotPlan, ShotSize
from .medium import Medium
from .points import REACH, Points
from .simulation import Unknown
from .stencil import HALO, weights
from .time_step import FLUSH

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
        gathered: nodes with a tap of a receiver, where fields are stored; else 0.
    """

    def __init__(self, session: Session, medium: Medium, scan: Scan, group: Group | None = None) -> None:
        self.session, self.scan, self.kind = session, scan, medium.keep.dtype
        self.grid = DeviceGrid.from_medium(medium, group or _group(session, medium))
        self._fills = self.grid.group[1] > 1
        factors = (session.upload(self.grid.packed(factor)) for factor in medium.factors)
        # By their names in the kernels.
        self._arguments: dict[str, Any] = {
            **dict(zip(("keep", "fade", "drive"), factors, strict=True)),
            "weights": session.upload(weights(medium.order).astype(self.kind)),
            "flush": self.kind.type(FLUSH),
            "steps": np.uint32(scan.steps),
            "receivers": np.uint32(len(scan.receivers.first)),
            "plane": np.uint64(self.grid.plane),
            "nodes": self.grid.nodes,
            **{
                name: np.uint32(getattr(self.grid, name))
                for name in ("first", "pitch", "slab", "blocks", "shift")
            },
        }
        self._receivers = dict(zip(("receiver", "reading"), self.uploaded(scan.receivers), strict=True))
        self._gather, self.gathered = {}, 0
        if scan.every:
            gather = Gather.from_receivers(self.grid, scan.receivers)
            self._gather = {name: session.upload(part) for name, part in vars(gather).items()}
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

    def advance(self, now: Any, new: Any) -> DeviceKernel:
        """The kernel of a step from ``now``: the field before it, in ``new``, becomes the one after it."""
        return self._kernel("advance", NOTHING, now=now, old=new)

    def scatter(self, now: Any, before: Any, stored: Any) -> DeviceKernel:
        """The kernel that stores what a change of the medium would scatter in the step from ``now``."""
        return self._kernel("scatter", self.scan.store, now=now, old=before, stored=stored)

    def exchange(
        self, store: int, now: Any, new: Any, stored: Any, points: dict[str, Any], *, reading: bool
    ) -> DeviceKernel:
        """The kernel that ends a step forwards.

        Args:
            store: what a step stores.
            now, new: fields before and after the step.
            stored: buffer.
            points: "traces", "emitter", "sending" and "wavelet", buffers.
            reading: whether receivers read, too.
        """
        receivers = self._arguments["receivers"] if reading else np.uint32(0)
        own = {**self._receivers, **points, "receivers": receivers}
        return self._kernel("exchange", store, now=now, next=new, stored=stored, slot=np.uint32(0), **own)

    def correlate(self, now: Any, stored: Any, image: Any, light: Any) -> DeviceKernel:
        """The kernel that correlates the adjoint field ``now`` with a stored one."""
        return self._kernel("correlate", NOTHING, adjoint=now, stored=stored, image=image, light=light)

    def inject(self, new: Any, residual: Any) -> DeviceKernel:
        """The kernel that ends a step backwards."""
        count = np.uint32(self.gathered)
        return self._kernel("inject", NOTHING, next=new, residual=residual, count=count, **self._gather)

    def misfit(self, name: str, **arguments: Any) -> DeviceKernel:
        """A kernel of ``misfits.cl`` with its arguments."""
        return self.session.own_kernel(_misfits(self.kind), name).set(**arguments)

    def _kernel(self, name: str, store: int, **own: Any) -> DeviceKernel:
        program = _waves(self.kind, len(self.grid.shape), store, self._fills)
        return self.session.own_kernel(program, name).set_from(self._arguments | own)


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
    return f"REAL={REALS[kind.name]}"


def tiles(emitters: int, most: int) -> Iterator[slice]:
    """Emitters in tiles of nearly equal size, at most ``most``."""
    number = -(-emitters // most)
    edges = [emitters * k // number for k in range(number + 1)] if number else []
    return (slice(begin, end) for begin, end in pairwise(edges))


def filled(number: int, group: int) -> int:
    """Work-items filled up to whole groups."""
    return -(-number // group) * group


def _group(session: Session, medium: Medium) -> Group:
    if not _is_processor(session.handle):
        return OTHER_GROUP
    return min(PROCESSOR_GROUPS, key=lambda group: DeviceGrid.from_medium(medium, group).filled[-1])


def _is_processor(handle: Any) -> bool:
    import pyopencl as cl

    return bool(handle.type & cl.device_type.CPU)
