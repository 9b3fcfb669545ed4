"""SART of many slices on an OpenCL device: wave fronts, rays, back-projection and updates stay there."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...arrays import Floats, Ints
from ...errors import InvalidInput
from ...opencl.program import Program
from ...opencl.session import DeviceKernel, Session
from ...rays.vectorised import LONGEST
from ..problem import Problem
from ..result import RESIDUAL_EDGES_S
from ..settings import Settings
from .emitter_pass import gaussian
from .sart_update import bounds_of

SOURCES = ("tomography/fronts", "tomography/sart")

# Work-items of a group that tracks a wave front, as many as the device takes; of a group that takes rays of
# one emitter.
GROUPS, RAYS_GROUP = (256, 128, 64, 32, 16, 8, 4, 2, 1), 64

# Part of a device's memory that slices in flight may fill, and slices in flight on a processor.
MEMORY_SHARE = 0.5
PROCESSOR_SLICES = 8

# Emitters of each slice in the trial of a device.
TRIAL_EMITTERS = 8

# Columns beside a diagonal in local memory, diagonals there, and rows of crossing times: as ``fronts.cl``.
BESIDE, SLOTS, CROSSINGS = 4, 6, 2


class SliceSize(NamedTuple):
    """Numbers that determine the memory of a slice on the device.

    Attributes:
        shape: of the image.
        emitters: in one call.
        receivers: of an emitter.
        rings: of receivers.
        members: emitters in one update.
    """

    shape: tuple[int, int]
    emitters: int
    receivers: int
    rings: int
    members: int

    @property
    def steps(self) -> int:
        """Steps of a ray at most."""
        return LONGEST * sum(self.shape)

    def _buffers(self) -> tuple[int, ...]:
        """Bytes of each array."""
        nodes, passes = self.shape[0] * self.shape[1], self.members
        rays = passes * self.receivers
        images = (8 * nodes, 8 * nodes, nodes, 4 * nodes, 4 * nodes)
        works = (8 * nodes * passes, 8 * nodes * passes, 16 * nodes * passes, 16 * nodes * passes)
        geometry = (8 * self.emitters * self.receivers, 32 * self.emitters, 16 * self.rings * self.receivers)
        return (*images, *works, 12 * self.steps * rays, 16 * rays, *geometry)

    @property
    def bytes(self) -> int:
        """Bytes of all arrays."""
        return sum(self._buffers())

    @property
    def largest_bytes(self) -> int:
        """Bytes of the largest array."""
        return max(self._buffers())


def slices_in_flight(session: Session, size: SliceSize) -> int:
    """Slices that the device holds together.

    Raises:
        InvalidInput: where it cannot hold one, naming the bytes or nodes of both.
    """
    device = session.device
    limit = MEMORY_SHARE * device.memory_bytes if device.memory_bytes else float("inf")
    largest = float(device.buffer_bytes or np.inf)
    slices = int(min(limit / size.bytes, largest / size.largest_bytes, 2**16))
    if slices < 1:
        raise InvalidInput(
            "nodes",
            f"{size.shape[0]}, for which a slice takes {size.bytes} bytes, {size.largest_bytes} in one array",
            f"at most {limit:.0f} bytes, {largest:.0f} in one array, on the device",
        )
    local = int(session.handle.local_mem_size)
    if ring_bytes(size.shape[1]) > local - 16 * GROUPS[0]:
        most = (local - 16 * GROUPS[0]) // 4 // (SLOTS + CROSSINGS) - BESIDE
        raise InvalidInput("nodes", size.shape[1], f"at most {most}, for the local memory of the device")
    return min(slices, PROCESSOR_SLICES) if device.kind == "cpu" else slices


def ring_bytes(nodes: int) -> int:
    """Local memory of a wave front on a grid of that side."""
    return 4 * (SLOTS * (nodes + BESIDE) + CROSSINGS * nodes)


# A kernel, its work-items, and those of a group; None: the driver's choice.
Launch = tuple[DeviceKernel, tuple[int, ...], tuple[int, ...] | None]


class DeviceSlices:
    """Slices on the device, and the work arrays of one update of each.

    A slice's results have the same bits whichever slices are in flight with it, however its emitters are
    distributed over calls, and on every run of one device.

    Args:
        session: the device.
        problems: of the slices; all with as many nodes and receivers.
        batches: emitters of each slice, in the order of the updates.
        slowness, coverage: (slices, nx, ny), s/m and m of ray.
        settings: of all slices.
    """

    def __init__(
        self,
        session: Session,
        problems: Sequence[Problem],
        batches: Sequence[Ints],
        slowness: Floats,
        coverage: Floats,
        settings: Settings,
    ) -> None:
        first = problems[0]
        self._session, self._settings, self._problem = session, settings, first
        self._weights = gaussian(settings.numerics.smoothing_nodes)
        slices, nx, ny = slowness.shape
        self._shape, self._nodes, self._passes = (nx, ny), nx * ny, slices * settings.numerics.subset
        self._emitters = max(map(len, batches))
        self._rings, self._receivers = first.receivers.shape[:2]
        self._most = LONGEST * (nx + ny)
        self._group = next(group for group in GROUPS if group <= session.handle.max_work_group_size)
        self._numbers = np.array([len(batch) for batch in batches], np.uint32)
        up, reserve, each = session.upload, session.reserve, list(zip(problems, batches, strict=True))
        grids, rays = self._passes * self._nodes, self._passes * self._receivers
        fields = reserve(16 * grids)
        # By their names in the kernels.
        self._buffers = {
            "slowness": up(np.ascontiguousarray(slowness)),
            "coverage": up(np.ascontiguousarray(coverage)),
            "region": up(np.stack([problem.region for problem in problems]).astype(np.uint8)),
            "numbers": up(self._numbers),
            "sources": up(self._padded([p.emitters[batch] / p.spacing for p, batch in each], 0.0)),
            "times": up(self._padded([p.delta_tof[batch] for p, batch in each], np.nan)),
            "ring": up(self._padded([p.ring[batch] for p, batch in each], 0).astype(np.int32)),
            "receivers": up(np.stack([problem.receivers / problem.spacing for problem in problems])),
            "scales": up(np.full(slices, settings.numerics.relaxation / first.spacing)),
            "weights": up(self._weights),
            "edges": up(RESIDUAL_EDGES_S),
            "crossings": reserve(8 * grids),
            "deviation": reserve(8 * grids),
            "fields": fields,
            "all_fields": fields,
            "sums": session.zeros(2 * grids, np.int64),
            "tracks": reserve(12 * rays * self._most),
            "taken": reserve(4 * rays),
            "residuals": reserve(8 * rays),
            "correction": reserve(4 * rays),
            "exponents": reserve(4 * self._passes),
            "changes": reserve(4 * slices * self._nodes),
            "blurred": reserve(4 * slices * self._nodes),
            "squares": session.zeros(slices * self._emitters, np.float64),
            "bins": session.zeros(slices * (RESIDUAL_EDGES_S.size - 1), np.uint32),
        }

    def run(self) -> None:
        """Enqueue the updates by all emitters."""
        kernels = self._kernels()
        for step in range(-(-self._emitters // self._settings.numerics.subset)):
            for kernel, size, group in kernels:
                kernel.set_from({"step": np.uint32(step)})
                self._session.launch(kernel, size, group)

    def images(self) -> tuple[Floats, Floats]:
        """Slowness and coverage of all slices."""
        slowness = np.empty((len(self._numbers), *self._shape))
        coverage = np.empty_like(slowness)
        self._session.download(slowness, self._buffers["slowness"])
        self._session.download(coverage, self._buffers["coverage"])
        return slowness, coverage

    def residuals(self) -> list[tuple[Floats, Ints]]:
        """Residuals of each slice before the updates.

        Returns:
            Sum of each emitter's squared residuals, s², and the histogram over ``RESIDUAL_EDGES_S``.
        """
        squares = np.empty((len(self._numbers), self._emitters))
        bins = np.empty((len(self._numbers), RESIDUAL_EDGES_S.size - 1), np.uint32)
        self._session.download(squares, self._buffers["squares"])
        self._session.download(bins, self._buffers["bins"])
        return [(squares[k, :number], bins[k].astype(np.int64)) for k, number in enumerate(self._numbers)]

    def _padded(self, rows: Sequence[Any], value: float) -> Any:
        """(slices, emitters, …) from the rows of each slice."""
        out = np.full((len(rows), self._emitters, *rows[0].shape[1:]), value, rows[0].dtype)
        for into, row in zip(out, rows, strict=True):
            into[: len(row)] = row
        return out

    def _kernels(self) -> list[Launch]:
        """The launches of one update, in order; their argument ``step`` is the number of the update."""
        (nx, ny), problem, session = self._shape, self._problem, self._session
        passes, nodes, slices, group = self._passes, self._nodes, len(self._numbers), self._group
        over_nodes, over_images = (_filled(nodes), passes), (_filled(nodes), slices)
        over_rays, rays_group = (_filled(self._receivers, RAYS_GROUP), passes), (RAYS_GROUP, 1)
        curved = self._settings.rays == "curved"
        numbers = {
            "nx": np.int32(nx),
            "ny": np.int32(ny),
            "nj": np.int32(nx),
            "nk": np.int32(ny),
            "nodes": np.int32(nodes),
            "reach": np.int32(self._weights.size - 1),
            "members": np.uint32(self._settings.numerics.subset),
            "emitters": np.uint32(self._emitters),
            "count": np.uint32(self._receivers),
            "rings": np.uint32(self._rings),
            "most": np.uint32(self._most),
            "edge_count": np.uint32(RESIDUAL_EDGES_S.size),
            "spacing": np.float64(problem.spacing),
            "water": np.float64(problem.spacing / problem.water_speed),
            "curved": np.int32(curved),
            "step": np.uint32(0),
            **dict(zip(("lowest", "highest"), map(np.float64, bounds_of(self._settings)), strict=True)),
        }

        def kernel(name: str, **own: Any) -> DeviceKernel:
            return session.own_kernel(_program(group), name).set_from(self._buffers | numbers | own)

        launches: list[Launch] = [
            (kernel("begin"), over_nodes, None),
            (kernel("interleave"), over_nodes, None),
            (kernel("trace"), over_rays, rays_group),
            (kernel("summarise"), (passes * group,), (group,)),
            (kernel("project"), over_rays, rays_group),
            (kernel("change"), over_images, None),
            (kernel("blur"), over_images, None),
            (kernel("apply"), over_images, None),
        ]
        if curved:
            import pyopencl as cl

            front = kernel("front", ring=cl.LocalMemory(ring_bytes(ny)))
            launches.insert(1, (front, (passes * group,), (group,)))
        return launches


def _program(group: int) -> Program:
    return Program(SOURCES, (f"GROUP={group}",))


def _filled(count: int, group: int = RAYS_GROUP) -> int:
    return -(-count // group) * group
