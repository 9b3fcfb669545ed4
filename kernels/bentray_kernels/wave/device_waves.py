"""Waves of several emitters on an OpenCL device: whole time loops forwards and backwards."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInput
from .device_grid import ROWS, DeviceGrid, Gather, Group
from .medium import Medium
from .points import REACH, Points
from .simulation import Unknown
from .stencil import HALO, weights
from .time_blocks import Poll
from .time_step import FLUSH

if TYPE_CHECKING:
    from ..opencl.session import Session

# Work-items of a group: on a processor a work-group runs in one thread, which turns a row into vectors.
PROCESSOR_GROUP: Group = (64, 1)
OTHER_GROUP: Group = (32, 4)

# Most emitters in flight on a processor: its caches hold the fields of one per core, and its memory is the
# host's.
PROCESSOR_EMITTERS = 4

# Time steps between two polls: the device has work for a block while the host waits for the one before.
BLOCK_STEPS = 64

# Part of the device's memory that the fields of the emitters in flight may take.
MEMORY_SHARE = 0.5

# Of so many stored fields one is taken for the illumination.
LIGHT_EVERY = 1

# What a step stores, as ``STORE`` of the program.
NOTHING = 0
STORES: dict[Unknown, int] = {"speed": 1, "attenuation": 2}


class Scan(NamedTuple):
    """What all emissions have in common.

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


class DeviceWaves:
    """A medium and its receivers on a device.

    An emitter's results have the same bits whichever emitters are in flight with it.

    Args:
        session: the device.
        medium: 2-D.
        scan: what all emissions have in common.
        group: work-items of a group; None: by the kind of the device.
    """

    def __init__(self, session: Session, medium: Medium, scan: Scan, group: Group | None = None) -> None:
        self._session, self._scan = session, scan
        self._kind = medium.keep.dtype
        self.grid = DeviceGrid.of(medium, group or _group(session))
        self._factors = [session.upload(self.grid.packed(factor)) for factor in medium.factors]
        self._taps = session.upload(weights().astype(self._kind))
        self._corners = session.upload(scan.receivers.first.astype(np.uint32))
        self._along = session.upload(np.ascontiguousarray(scan.receivers.weights, self._kind))
        self._gather = Gather.of(self.grid, scan.receivers) if scan.every else None

    @property
    def image_nodes(self) -> int:
        """Of the image alone."""
        return math.prod(self.grid.nodes[1:])

    @property
    def emitter_bytes(self) -> tuple[int, int]:
        """Bytes of one emitter in flight, and of the largest of its arrays."""
        stored = self._scan.slots * self.image_nodes
        samples = self._scan.steps * len(self._scan.receivers.first)
        images = 2 * self.image_nodes if stored else 0
        arrays = (self.grid.plane, self.grid.plane, samples, stored, images)
        return self._kind.itemsize * sum(arrays), self._kind.itemsize * max(arrays)

    def tiles(self, emitters: int, memory_bytes: float = math.inf) -> Iterator[slice]:
        """The emitters in tiles of nearly equal size that the device holds.

        Args:
            emitters: their number.
            memory_bytes: limit beside that of the device.

        Raises:
            InvalidInput: where one emitter does not fit, naming the bytes of both.
        """
        handle = self._session.handle
        whole, largest = self.emitter_bytes
        limit = min(memory_bytes, MEMORY_SHARE * handle.global_mem_size)
        most = int(min(limit // whole, handle.max_mem_alloc_size // largest))
        if most < 1:
            found = f"{whole} bytes for an emitter, {largest} of them in one array"
            accepted = f"at most {limit:.0f} bytes, {handle.max_mem_alloc_size} in one array"
            raise InvalidInput("speed", found, f"{accepted}, on {handle.name}")
        if _is_processor(handle):
            most = min(most, handle.max_compute_units, PROCESSOR_EMITTERS)
        number = -(-emitters // most)
        edges = [emitters * k // number for k in range(number + 1)] if number else []
        return (slice(begin, end) for begin, end in pairwise(edges))

    def forward(self, sources: Points, pulse: NDArray[Any], poll: Poll) -> tuple[NDArray[Any], Any]:
        """Traces of a tile of emitters, and the buffer with their stored fields.

        Args:
            sources: the emitters, on the medium's grid.
            pulse: (steps,), their source.
            poll: see ``time_blocks``.

        Returns:
            traces: (emitters, steps, receivers).
            stored: on the device, [slot][emitter][nx][ny].
        """
        session, scan, grid, kind = self._session, self._scan, self.grid, self._kind
        number, receivers = len(sources.first), len(scan.receivers.first)
        traces = np.empty((number, scan.steps, receivers), kind)
        store = STORES[scan.by] if scan.every else NOTHING
        with session.lock:
            fields = [session.zeros(number * grid.plane, kind) for _ in range(2)]
            samples = session.reserve(max(traces.nbytes, 1))
            stored = session.reserve(max(scan.slots * number * self.image_nodes * kind.itemsize, 1))
            at = session.upload(sources.first.astype(np.uint32))
            along = session.upload(np.ascontiguousarray(sources.weights, kind))
            wavelet = session.upload(pulse.astype(kind))
            sizes = _uints(scan.steps, receivers, grid.shift, grid.pitch, grid.plane)
            points = (self._corners, self._along, samples, at, along, wavelet, *sizes, *self._store(stored))
            # A kernel for each role of the two fields, so that only numbers change from step to step.
            stepping, ending = [], []
            for now, new in (fields, fields[::-1]):
                stepping.append({use: self._advance(use, now, new, stored) for use in {NOTHING, store}})
                drive = self._factors[2]
                ending.append(
                    {use: self._kernel("exchange", use, now, new, drive, *points) for use in {NOTHING, store}}
                )
            for n in self._polled(poll):
                slot, rest = divmod(n, scan.every) if scan.every else (0, 1)
                use = NOTHING if rest else store
                step, end = stepping[n % 2][use], ending[n % 2][use]
                if use:
                    step.set_arg(12, np.uint32(slot))
                    end.set_arg(16, np.uint32(slot))
                session.launch(step, (*grid.work_items, number), (*grid.group, 1))
                end.set_arg(17, np.uint32(n))
                session.launch(end, (receivers + (2 * REACH) ** 2, number), None)
            session.download(traces, samples)
        return traces, stored

    def backward(self, residual: NDArray[Any], stored: Any, poll: Poll) -> tuple[NDArray[Any], NDArray[Any]]:
        """The adjoint fields of a tile correlated with its stored ones, and the energy of the stored ones.

        Args:
            residual: (emitters, steps, receivers), of the medium's type.
            stored: as ``forward`` gives it.
            poll: see ``time_blocks``.

        Returns:
            (emitters, nx, ny), twice.
        """
        assert self._gather is not None
        session, scan, grid, kind = self._session, self._scan, self.grid, self._kind
        number, nodes = len(residual), len(self._gather.node)
        image, light = (np.empty((number, *grid.nodes[1:]), kind) for _ in range(2))
        with session.lock:
            fields = [session.zeros(number * grid.plane, kind) for _ in range(2)]
            sums = [session.zeros(image.size, kind) for _ in range(2)]
            gather = [session.upload(part) for part in vars(self._gather).values()]
            samples = session.upload(residual)
            places = (*_uints(grid.shift, grid.pitch, grid.plane), self._nodes)
            sizes = _uints(scan.steps, residual.shape[2], grid.plane)
            receivers = (self._factors[2], *gather, samples, *sizes)
            correlating, stepping, ending = [], [], []
            for now, new in (fields, fields[::-1]):
                correlating.append(self._kernel("correlate", NOTHING, now, stored, *sums, *places))
                stepping.append(self._advance(NOTHING, now, new, stored))
                ending.append(self._kernel("inject", NOTHING, new, *receivers))
            for k in self._polled(poll):
                n = scan.steps - 1 - k
                slot, rest = divmod(n, scan.every)
                if not rest:
                    correlate = correlating[k % 2]
                    correlate.set_arg(8, np.uint32(slot))
                    correlate.set_arg(9, np.uint32(slot % LIGHT_EVERY == 0))
                    session.launch(correlate, (*grid.nodes[:0:-1], number), None)
                session.launch(stepping[k % 2], (*grid.work_items, number), (*grid.group, 1))
                ending[k % 2].set_arg(10, np.uint32(n))
                session.launch(ending[k % 2], (nodes, number), None)
            session.download(image, sums[0])
            session.download(light, sums[1])
        return image, light

    def _polled(self, poll: Poll) -> Iterator[int]:
        """Numbers of the steps; ``poll`` is called between blocks, at most two of which are waiting."""
        before: Any = None
        for begin in range(0, self._scan.steps, BLOCK_STEPS):
            poll()
            yield from range(begin, min(begin + BLOCK_STEPS, self._scan.steps))
            marker = self._session.mark()
            if before is not None:
                before.wait()
            before = marker

    def _advance(self, store: int, now: Any, new: Any, stored: Any) -> Any:
        """The kernel of a step from ``now``, the field before it in ``new``."""
        grid = self.grid
        sizes = _uints(grid.first, grid.pitch, grid.plane)
        flush = self._kind.type(FLUSH)
        return self._kernel(
            "advance", store, now, new, *self._factors, self._taps, flush, *sizes, *self._store(stored)
        )

    def _store(self, stored: Any) -> tuple[Any, ...]:
        return self._nodes, stored, np.uint32(0)

    @property
    def _nodes(self) -> Any:
        return np.array((*self.grid.nodes, 0), np.uint32)

    def _kernel(self, name: str, store: int, *arguments: Any) -> Any:
        from ..opencl.session import set_arguments

        real = "float" if self._kind == np.float32 else "double"
        defines = (f"REAL={real}", f"HALO={HALO}", f"TAPS={2 * REACH}", f"ROWS={ROWS}", f"STORE={store}")
        kernel = self._session.own_kernel(("wave/plane",), name, *defines)
        set_arguments(kernel, *arguments)
        return kernel


def _group(session: Session) -> Group:
    return PROCESSOR_GROUP if _is_processor(session.handle) else OTHER_GROUP


def _is_processor(handle: Any) -> bool:
    import pyopencl as cl

    return bool(handle.type & cl.device_type.CPU)


def _uints(*values: int) -> tuple[np.uint32, ...]:
    return tuple(np.uint32(value) for value in values)
