"""Batches of shots on an OpenCL device: time loops forwards and backwards, without host round trips."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from .adjoint import LIGHT_EVERY
from .device_waves import NOTHING, DeviceWaves, Launch, filled
from .points import REACH, Points
from .time_blocks import Poll

# Time steps between two polls: the device has work for a block while the host waits for the one before.
BLOCK_STEPS = 64

# Work-items of a group that takes points of one emitter.
POINTS_GROUP = 64


class ShotBatch:
    """Shots of some emitters of a scan, simulated together.

    An emitter's results have the same bits whichever shots are in its batch, and whether its time
    loop is divided or not.

    Args:
        waves: the medium on the device.
        sources: the emitters on its grid.
        pulse: (steps,), their source.
        segments: of the time loop, see ``device_memory.ShotPlan``.
        poll: see ``time_blocks``.
    """

    def __init__(self, waves: DeviceWaves, sources: Points, pulse: Floats, segments: int, poll: Poll) -> None:
        session, kind = waves.session, waves.kind
        self._waves, self._session, self._poll = waves, session, poll
        self._emitters = len(sources.first)
        size, scan = waves.size, waves.scan
        self._held = size.held(segments)
        # First step of each segment, and the end of the last.
        length = self._held * scan.every or scan.steps
        self._edges = [*range(0, scan.steps, length), scan.steps]
        self._shape = (self._emitters, scan.steps, len(scan.receivers.first))
        self._samples = session.reserve(max(math.prod(self._shape) * kind.itemsize, 1))
        self._stored = session.reserve(max(self._emitters * self._held * size.image * kind.itemsize, 1))
        emitter, sending = waves.uploaded(sources)
        wavelet = session.upload(pulse.astype(kind))
        self._points = {"emitter": emitter, "sending": sending, "wavelet": wavelet}
        self._stepping = waves.grid.work_items(self._emitters), (*waves.grid.group, 1)
        self._over_the_image = waves.over_the_image(self._emitters)
        self._checkpoints: dict[int, list[Any]] = {}

    def forward(self) -> None:
        """Enqueue the time loop."""
        with self._session.lock:
            fields = self._fields()
            last = len(self._edges) - 2
            for segment in range(last + 1):
                if 0 < segment < last:
                    self._checkpoints[segment] = [self._session.copied(field) for field in fields]
                self._forward(fields, segment, storing=segment == last, reading=True)

    def traces(self) -> NDArray[Any]:
        """Those of the emitters, (emitters, steps, receivers)."""
        traces = np.empty(self._shape, self._waves.kind)
        with self._session.lock:
            self._session.download(traces, self._samples)
        return traces

    def compare(
        self, program: str, recorded: NDArray[Any], weight: NDArray[Any], scale: float
    ) -> tuple[Floats, Floats]:
        """Replace the traces by residuals, on the device.

        Args:
            program: of ``misfits.cl``.
            recorded, weight: (emitters, steps, receivers), of the medium's type.
            scale: of the recorded traces.

        Returns:
            The misfit of each emitter, and the divisor of its residuals.
        """
        session, (emitters, steps, receivers) = self._session, self._shape
        sums = np.empty((emitters, receivers, 2))
        with session.lock:
            buffers = [session.upload(array) for array in (recorded, weight, sums)]
            kernel = self._waves.misfit(
                program,
                traces=self._samples,
                **dict(zip(("recorded", "weight", "sums"), buffers, strict=True)),
                steps=np.uint32(steps),
                receivers=np.uint32(receivers),
                scale=np.float64(scale),
            )
            session.launch(kernel, (receivers, emitters), None)
            session.download(sums, buffers[2])
        values, divisors = sums.sum(axis=1).T
        divisors = np.where(divisors > 0.0, divisors, 1.0)
        return values / divisors, divisors

    def replace_traces(self, residual: NDArray[Any]) -> None:
        """Replace the traces by residuals, (emitters, steps, receivers), of the medium's type."""
        with self._session.lock:
            self._samples = self._session.upload(residual)

    def backward(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """The adjoint fields of the residuals correlated with the stored ones, and the energy of the latter.

        To be called once, when residuals have replaced the traces of ``forward``.

        Returns:
            (emitters, nx, ny[, nz]), twice.
        """
        session, waves = self._session, self._waves
        shape = (self._emitters, *waves.grid.shape)
        image, light = np.empty(shape, waves.kind), np.empty(shape, waves.kind)
        with session.lock:
            adjoint, sums = self._fields(), [session.zeros(image.size, waves.kind) for _ in range(2)]
            for segment in reversed(range(len(self._edges) - 1)):
                if segment < len(self._edges) - 2:
                    fields = self._checkpoints.pop(segment) if segment else self._fields()
                    self._forward(fields, segment, storing=True, reading=False)
                self._backward(adjoint, segment, sums)
            session.download(image, sums[0])
            session.download(light, sums[1])
        return image, LIGHT_EVERY * light

    def _forward(self, fields: list[Any], segment: int, *, storing: bool, reading: bool) -> None:
        """Enqueue the steps of a segment."""
        waves, every = self._waves, self._waves.scan.every
        store = waves.scan.store if storing else NOTHING
        uses = {NOTHING, store}
        # A kernel for each role of the two fields, so that only numbers change from step to step.
        scattering: list[Any] = []
        stepping, ending = [], []
        points = {"traces": self._samples, **self._points}
        for now, new in (fields, fields[::-1]):
            if store:
                scattering.append(waves.scatter(now, new, self._stored))
            stepping.append(waves.advance(now, new))
            ending.append(
                {use: waves.exchange(use, now, new, self._stored, points, reading=reading) for use in uses}
            )
        ends = self._of_points((self._shape[2] if reading else 0) + (2 * REACH) ** len(waves.grid.shape))
        for n in self._steps(segment):
            use = store if store and n % every == 0 else NOTHING
            end = ending[n % 2][use]
            if use:
                slot = np.uint32(n // every % self._held)
                scattering[n % 2].set(slot=slot)
                self._session.launch(scattering[n % 2], *self._over_the_image)
                end.set(slot=slot)
            self._session.launch(stepping[n % 2], *self._stepping)
            end.set(step=np.uint32(n))
            self._session.launch(end, *ends)

    def _backward(self, adjoint: list[Any], segment: int, sums: list[Any]) -> None:
        """Enqueue the steps of a segment, the last one first."""
        waves, every = self._waves, self._waves.scan.every
        correlating, stepping, ending = [], [], []
        for now, new in (adjoint, adjoint[::-1]):
            correlating.append(waves.correlate(now, self._stored, *sums))
            stepping.append(waves.advance(now, new))
            ending.append(waves.inject(new, self._samples))
        ends = self._of_points(waves.gathered)
        for n in self._steps(segment, backwards=True):
            if n % every == 0:
                slot = n // every
                lit = np.uint32(slot % LIGHT_EVERY == 0)
                correlating[n % 2].set(slot=np.uint32(slot % self._held), lit=lit)
                self._session.launch(correlating[n % 2], *self._over_the_image)
            self._session.launch(stepping[n % 2], *self._stepping)
            ending[n % 2].set(step=np.uint32(n))
            self._session.launch(ending[n % 2], *ends)

    def _of_points(self, number: int) -> Launch:
        """A launch over taps or nodes of each emitter."""
        return (filled(number, POINTS_GROUP), self._emitters), (POINTS_GROUP, 1)

    def _fields(self) -> list[Any]:
        """Two fields of zeros."""
        count = self._emitters * self._waves.grid.plane
        return [self._session.zeros(count, self._waves.kind) for _ in range(2)]

    def _steps(self, segment: int, *, backwards: bool = False) -> Iterator[int]:
        """Numbers of the steps; ``poll`` is called between blocks, at most two of which are waiting."""
        begin, end = self._edges[segment : segment + 2]
        before: Any = None
        for first in range(begin, end, BLOCK_STEPS):
            self._poll()
            block = range(first, min(first + BLOCK_STEPS, end))
            yield from (begin + end - 1 - n for n in block) if backwards else block
            marker = self._session.mark()
            if before is not None:
                before.wait()
            before = marker
