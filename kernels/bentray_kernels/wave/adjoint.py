"""Adjoint-state gradient: derivative of a misfit by speed or loss at every node."""

import threading
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..compilation.compiled import kernel
from ..errors import InvalidInput
from .cache_lines import zeros
from .light_cone import BLOCK_STEPS, TILE, Spans, everywhere, light_cone
from .medium import Medium
from .points import Points
from .simulation import Unknown, check_2d, cut, fields_of, forward, place_scan
from .stencil import HALO, weights
from .time_blocks import Poll, no_poll, split_steps
from .time_step import advance, inject, inside
from .vector_width import use_widest_vectors

# Of so many stored fields one is taken for the illumination, which only scales steps.
LIGHT_EVERY = 4

# A misfit of simulated traces (nrx, nt): its value, and its derivative by every sample.
Misfit = Callable[[NDArray[Any]], tuple[float, Floats]]


class _Kept(threading.local):
    """The stored fields of a thread's last emission, whose memory the next one of the same size takes.

    The system clears fresh memory page by page, in a seventh of the time of a gradient.
    """

    fields: NDArray[Any] | None = None


_kept = _Kept()


class MisfitGradient(NamedTuple):
    """Misfit of one emitter and its derivatives.

    Attributes:
        misfit: value.
        gradient: (nx, ny), of the misfit by the speed, s/m, or by the attenuation, m/Np.
        illumination: (nx, ny), energy of the scattering sources; large near the emitter.
    """

    misfit: float
    gradient: Floats
    illumination: Floats


def misfit_gradient(
    medium: Medium,
    emitter: Floats,
    receivers: Floats,
    wavelet: Floats,
    misfit: Misfit,
    every: int = 1,
    by: Unknown = "speed",
    poll: Poll = no_poll,
    until: Ints | None = None,
) -> MisfitGradient:
    """Misfit of one emitter's traces and its gradient (Plessix, Geophys. J. Int. 167, 2006).

    The gradient is that of the discrete scheme: exact for ``every = 1``. Larger values store less of the wave
    field and are as accurate while the highest frequency is sampled more than twice a period. The edges are
    fixed, and for a gradient by speed also the damping of the medium.

    Args:
        emitter: (2,), m.
        receivers: (nrx, 2), m.
        wavelet: (nt,), as for ``simulate``.
        misfit: of the traces.
        every: time steps between stored fields.
        by: variable of the gradient.
        poll: see ``time_blocks``.
        until: (nrx,), samples of each trace that the misfit depends on; the others are 0. All by default.

    Raises:
        InvalidInput: as ``simulate``; a 3-D medium; a step between fields below 1.
    """
    if every < 1:
        raise InvalidInput("every", every, "at least 1 step")
    check_2d(medium)
    source, detectors = place_scan(medium, emitter, receivers, wavelet)
    spans = everywhere(medium) if until is None else light_cone(medium, source, detectors, until)
    # Taken out while it is in use: a misfit may compute another gradient.
    storage, _kept.fields = _kept.fields, None
    if storage is None or (storage.shape, storage.dtype) != fields_of(medium, wavelet.size, every):
        storage = np.empty(*fields_of(medium, wavelet.size, every))
    traces, scattered = forward(medium, source, detectors, wavelet, every, by, spans, poll, storage)
    value, residual = misfit(traces if until is None else cut(traces, until))
    image, light = backward(medium, detectors, residual, scattered, every, spans, poll)
    _kept.fields = storage
    return gradient_of(medium, float(np.abs(wavelet).max()), value, image, light, every, by)


def gradient_of(
    medium: Medium, scale: float, misfit: float, image: Floats, light: Floats, every: int, by: Unknown
) -> MisfitGradient:
    """The gradient from the correlated fields of ``backward``; ``scale`` is the pressure that is 1 there."""
    # By (c dt / h)^2, the factor of a step, and by sigma dt = c alpha dt; the adjoint field has it too.
    along = 2.0 if by == "speed" else -(medium.spacing**2) / medium.time_step_s
    return MisfitGradient(misfit, along * every * scale * image / medium.speed, light)


def backward(
    medium: Medium,
    detectors: Points,
    residual: Floats,
    scattered: NDArray[Any],
    every: int,
    spans: Spans | None = None,
    poll: Poll = no_poll,
) -> tuple[Floats, Floats]:
    """The adjoint field correlated with a stored one: (nx, ny), and the energy of the stored one.

    Args:
        detectors: receivers on the grid.
        residual: (nrx, nt), derivative of the misfit by every sample.
        scattered: as ``forward`` gives it.
        spans: as ``forward`` took them.
        poll: see ``time_blocks``.
    """
    kind = medium.keep.dtype
    fields = [zeros(medium.keep.shape, kind) for _ in range(2)]
    image, light = np.zeros(medium.speed.shape, kind), np.zeros(medium.speed.shape, kind)
    scale = float(np.abs(residual).max())
    taps, sources = weights(medium.order).astype(kind), (residual / (scale or 1.0)).astype(kind)
    spans = everywhere(medium) if spans is None else spans
    shot = (*fields, medium.factors, taps, detectors, sources)
    for begin, end in split_steps(residual.shape[1], medium.keep.size, poll):
        _backward(begin, end, shot, spans, medium.margin, every, (scattered, image, light))
    return scale * image.astype(np.float64), LIGHT_EVERY * light.astype(np.float64)


@kernel
def _backward(begin: int, end: int, shot: Any, spans: Any, margin: int, every: int, images: Any) -> None:
    now, old, (keep, fade, drive), weights, receivers, residual = shot
    scattered, image, light = images
    # At the start of iteration n, ``now`` is the adjoint field of equation n. The scheme is symmetric except
    # for the direction of time, so the same step advances the adjoint field backwards.
    use_widest_vectors()
    nx, ny = image.shape
    last = residual.shape[1] - 1
    for n in range(last - begin, last - end, -1):
        part = spans[min(n // BLOCK_STEPS, spans.shape[0] - 1)]
        if n % every == 0:
            lit = n % (every * LIGHT_EVERY) == 0
            for i in range(nx):
                left, right = inside(part[(i + margin - HALO) // TILE], margin, ny)
                adjoint = now[i + margin, margin + left : margin + right]
                wave, out = scattered[n // every, i, left:right], image[i, left:right]
                for j in range(out.shape[0]):
                    out[j] += adjoint[j] * wave[j]
                if lit:
                    energy = light[i, left:right]
                    for j in range(energy.shape[0]):
                        energy[j] += wave[j] * wave[j]
        advance(now, old, keep, fade, drive, weights, part)
        for r in range(residual.shape[0]):
            if residual[r, n] != 0:
                inject(old, drive, receivers.first[r], receivers.weights[r], residual[r, n])
        now, old = old, now
