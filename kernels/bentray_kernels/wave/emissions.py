"""Traces and gradients of many emissions of one scan, by compiled code or on an OpenCL device."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import InvalidInput
from ..opencl import Session, computing_on, session_or_warning
from .adjoint import MisfitGradient, gradient_of, misfit_gradient
from .device_shots import ShotBatch
from .device_waves import DeviceWaves, Scan, tiles
from .medium import Medium
from .points import Points
from .simulation import Unknown, cut, place_scan, simulate
from .time_blocks import Poll, no_poll

# What simulates the waves.
Engine = Literal["compiled", "opencl"]

# The misfit of the k-th emission's traces, (receivers, nt): its value, and its derivative by every sample.
EmissionMisfit = Callable[[int, NDArray[Any]], tuple[float, Floats]]


class Observed(NamedTuple):
    """A misfit that exists as a program of devices, which then compare the traces where they are.

    Attributes:
        program: its name in ``misfits.cl``.
        traces: of the k-th emission: recorded traces and their weights, (nt, nrx) each, of the medium's type;
            of all receivers, with weight 0 for those that are not used.
    """

    program: str
    traces: Callable[[int], tuple[NDArray[Any], NDArray[Any]]]


class Emissions(NamedTuple):
    """Emissions with the same receivers and the same source.

    Attributes:
        emitters: (k, d), m, d = 2 or 3, node 0 of the image at 0.
        receivers: (nrx, d), m.
        valid: for each emission the indices of the receivers whose traces are used.
        wavelet: (nt,), as for ``simulate``.
        until: for each emission the samples that are needed of the trace of each of its receivers, see
            ``simulate``; all where it is None.
    """

    emitters: Floats
    receivers: Floats
    valid: Sequence[Ints]
    wavelet: Floats
    until: Sequence[Ints] | None = None

    @property
    def elements(self) -> tuple[Floats, Floats]:
        """Emitters and receivers."""
        return self.emitters, self.receivers

    def needed(self, k: int) -> Ints | None:
        """``until`` of the k-th emission."""
        return None if self.until is None else self.until[k]


def simulate_emissions(
    medium: Medium,
    emissions: Emissions,
    poll: Poll = no_poll,
    engine: Engine = "compiled",
    memory_bytes: float = math.inf,
) -> Iterator[NDArray[Any]]:
    """Traces of each emission, (its receivers, nt), in their order.

    On a device many emissions are in flight; the traces of each have the same bits however many they are.
    They differ from those of compiled code by less than 1e-5 of the largest sample in float32.

    Args:
        medium: 2-D or 3-D.
        emissions: what is simulated.
        poll: see ``time_blocks``.
        engine: ``opencl`` for the device of ``opencl.device_selection``.
        memory_bytes: limit of the fields of emissions in flight on a device, beside its own memory.

    Raises:
        InvalidInput: as ``simulate``; for a device that cannot hold one emission, and where
            ``BENTRAY_OPENCL_DEVICE`` does not match one device.
        DeviceLostError: when the device fails.

    Warns:
        OpenCLFallbackWarning: once, where no device passes its self-test and compiled code is used instead.
    """
    placed = place_scan(medium, *emissions.elements, emissions.wavelet)
    session = _session(engine) if len(emissions.emitters) else None
    if session is None:
        for k, (emitter, valid) in enumerate(zip(emissions.emitters, emissions.valid, strict=True)):
            at, until = emissions.receivers[valid], emissions.needed(k)
            yield simulate(medium, emitter, at, emissions.wavelet, poll, until)
        return
    with computing_on(session):
        for tile, batch, scale in _batches(session, medium, emissions, placed, poll, memory_bytes):
            for k, samples in enumerate(batch.traces(), tile.start):
                yield _traces(emissions, k, samples, scale)


def emission_misfits(
    medium: Medium,
    emissions: Emissions,
    misfit: EmissionMisfit,
    poll: Poll = no_poll,
    engine: Engine = "compiled",
    observed: Observed | None = None,
    memory_bytes: float = math.inf,
) -> Iterator[float]:
    """Misfit of each emission, in their order; see ``misfit_gradients``."""
    session = _session(engine) if observed and len(emissions.emitters) else None
    if session is None or observed is None:
        simulated = simulate_emissions(medium, emissions, poll, engine, memory_bytes)
        yield from (misfit(k, traces)[0] for k, traces in enumerate(simulated))
        return
    placed = place_scan(medium, *emissions.elements, emissions.wavelet)
    with computing_on(session):
        for tile, batch, scale in _batches(session, medium, emissions, placed, poll, memory_bytes):
            yield from _compared(batch, observed, tile, scale)[0].tolist()


def misfit_gradients(
    medium: Medium,
    emissions: Emissions,
    misfit: EmissionMisfit,
    every: int = 1,
    by: Unknown = "speed",
    poll: Poll = no_poll,
    engine: Engine = "compiled",
    observed: Observed | None = None,
    memory_bytes: float = math.inf,
) -> Iterator[MisfitGradient]:
    """Misfit and gradient of each emission, in their order; see ``misfit_gradient``.

    On a device an emission's gradient has the same bits on every run, however many emissions are in batch.
    It differs from that of compiled code by less than 1e-4 of its largest value in float32. Where the stored
    fields of one emission do not fit, checkpoints take their place, and most steps forwards are made twice.

    Args:
        medium: 2-D; for a device 3-D, too.
        emissions: what is simulated.
        misfit: of the traces of an emission.
        every: time steps between stored fields.
        by: variable of the gradient.
        observed: the same misfit as a program, so that no trace leaves the device.
        poll, engine, memory_bytes: as ``simulate_emissions``.

    Raises:
        InvalidInput: as ``simulate_emissions``; a step between fields below 1; 3-D for compiled code.
    """
    if every < 1:
        raise InvalidInput("every", every, "at least 1 step")
    placed = place_scan(medium, *emissions.elements, emissions.wavelet)
    session = _session(engine) if len(emissions.emitters) else None
    if session is None:
        for k, (emitter, valid) in enumerate(zip(emissions.emitters, emissions.valid, strict=True)):
            at = emissions.receivers[valid]

            def compare(traces: NDArray[Any], k: int = k) -> tuple[float, Floats]:
                return misfit(k, traces)

            until = emissions.needed(k)
            yield misfit_gradient(medium, emitter, at, emissions.wavelet, compare, every, by, poll, until)
        return
    with computing_on(session):
        for tile, batch, scale in _batches(session, medium, emissions, placed, poll, memory_bytes, every, by):
            if observed is None:
                values, factors = _compared_here(batch, emissions, misfit, tile, scale)
            else:
                values, divisors = _compared(batch, observed, tile, scale)
                # The residuals are derivatives by samples in the unit of the device.
                factors = 1.0 / (divisors * scale)
            for value, factor, image, light in zip(values, factors, *batch.backward(), strict=True):
                summed = factor * image.astype(np.float64)
                yield gradient_of(medium, scale, float(value), summed, light.astype(np.float64), every, by)


def _batches(
    session: Session,
    medium: Medium,
    emissions: Emissions,
    placed: tuple[Points, Points],
    poll: Poll,
    memory_bytes: float,
    every: int = 0,
    by: Unknown = "speed",
) -> Iterator[tuple[slice, ShotBatch, float]]:
    """Tiles of emissions, simulated together on the device, and the pressure that is 1 there."""
    sources, receivers = placed
    waves = DeviceWaves(session, medium, Scan(receivers, emissions.wavelet.size, every, by))
    plan = waves.plan(memory_bytes)
    # A point source is 1 / spacing^d on its node; the factors contain spacing^2.
    largest = float(np.abs(emissions.wavelet).max())
    scale = largest / medium.spacing ** (medium.speed.ndim - 2)
    for tile in tiles(len(emissions.emitters), plan.emitters):
        shots = Points(sources.first[tile], sources.weights[tile])
        batch = ShotBatch(waves, shots, emissions.wavelet / largest, plan.segments, poll)
        batch.forward()
        yield tile, batch, scale


def _compared(batch: ShotBatch, observed: Observed, tile: slice, scale: float) -> tuple[Floats, Floats]:
    """Misfits of emissions in flight, and divisors of the residuals that have replaced their traces."""
    recorded, weight = zip(*(observed.traces(k) for k in range(tile.start, tile.stop)), strict=True)
    return batch.compare(observed.program, np.stack(recorded), np.stack(weight), 1.0 / scale)


def _compared_here(
    batch: ShotBatch, emissions: Emissions, misfit: EmissionMisfit, tile: slice, scale: float
) -> tuple[Floats, Floats]:
    """Misfits of emissions in flight, and factors of the residuals that have replaced their traces."""
    traces = batch.traces()
    residuals, values, factors = np.zeros_like(traces), np.empty(len(traces)), np.empty(len(traces))
    for k, (samples, valid) in enumerate(zip(traces, emissions.valid[tile], strict=True)):
        values[k], residual = misfit(tile.start + k, _traces(emissions, tile.start + k, samples, scale))
        factors[k] = np.abs(residual).max(initial=0.0)
        residuals[k][:, valid] = (residual / (factors[k] or 1.0)).T
    batch.replace_traces(residuals)
    return values, factors


def _session(engine: Engine) -> Session | None:
    return None if engine == "compiled" else session_or_warning(instead="compiled code")


def _traces(emissions: Emissions, k: int, samples: NDArray[Any], scale: float) -> NDArray[Any]:
    """Traces of the k-th emission's receivers, (receivers, nt), from those of all, (nt, receivers)."""
    traces = np.ascontiguousarray(samples[:, emissions.valid[k]].T)
    traces *= samples.dtype.type(scale)
    until = emissions.needed(k)
    return traces if until is None else cut(traces, until)
