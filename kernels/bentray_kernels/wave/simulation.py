"""Forward simulation of one emitter: pressure traces, and the wave field for a gradient."""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..compilation.compiled import kernel
from ..errors import InvalidInput
from .cache_lines import zeros
from .light_cone import BLOCK_STEPS, Spans, everywhere, light_cone
from .medium import Medium
from .points import Points, points_at
from .stencil import OPTIMISED, weights
from .time_blocks import Poll, no_poll, split_steps
from .time_step import (
    advance,
    advance_storing,
    begin_loss_scattering,
    end_loss_scattering,
    inject,
    read,
    spread,
)
from .time_step_3d import advance_3d, inject_3d, read_3d

# Variables of a gradient.
Unknown = Literal["speed", "attenuation"]

# Fewest nodes per shortest wavelength of a source. The phase speed in space is too low by 6.3 % at 2.5 nodes,
# 2.2 % at 3, 0.34 % at 4, 0.07 % at 5 with order 8 (``stencil.phase_error``, which a test measures); with
# optimised weights by 3 % at 2.5, 0.4 % at 3 and at most 0.035 % from 3.3 on. Resampling compensates that of
# water, so that the weak end of a pulse's band may come near the limit.
MIN_POINTS, MIN_POINTS_OPTIMISED = 2.5, 2.0

# The band of a source ends where its amplitude falls below this fraction of the highest.
BAND_EDGE = 0.03


def simulate(
    medium: Medium,
    emitter: Floats,
    receivers: Floats,
    wavelet: Floats,
    poll: Poll = no_poll,
    until: Ints | None = None,
) -> Floats:
    """Traces of a point source.

    Second order in time, in space that of the medium; free of temporal dispersion where wavelet and traces
    are resampled by ``waveform.trace_resampling.resampler``. Releases the GIL.

    Args:
        medium: of two or three axes.
        emitter: (d,), m, node 0 of the image at 0.
        receivers: (nrx, d), m.
        wavelet: (nt,), the source s(t) of (1/c^2) p'' - laplacian p = s(t) delta(x), a sample a time step.
        poll: see ``time_blocks``.
        until: (nrx,), samples of each trace that are needed; the others are 0. All by default. Without the
            late ones a simulation in a plane takes half the time or less, see ``light_cone``.

    Returns:
        (nrx, nt), of the medium's type; sample n is the pressure at n time steps.

    Raises:
        InvalidInput: elements outside the image, a wavelet with waves too short for the grid.
    """
    source, detectors = place_scan(medium, emitter, receivers, wavelet)
    spans = None if until is None or medium.speed.ndim == 3 else light_cone(medium, source, detectors, until)
    traces = forward(medium, source, detectors, wavelet, 0, spans=spans, poll=poll)[0]
    return traces if until is None else cut(traces, until)


def cut(traces: NDArray[Any], until: Ints) -> NDArray[Any]:
    """The traces with zeros from sample ``until`` of each on."""
    return np.where(np.arange(traces.shape[1]) < until[:, None], traces, traces.dtype.type(0))


def place_scan(medium: Medium, emitter: Floats, receivers: Floats, wavelet: Floats) -> tuple[Points, Points]:
    """Source and receivers of one emission on the medium's grid; arguments as ``simulate``.

    Raises:
        InvalidInput: elements outside the image, a wavelet with waves too short for the grid.
    """
    points = points_per_wavelength(medium, wavelet)
    fewest = MIN_POINTS_OPTIMISED if medium.order == OPTIMISED else MIN_POINTS
    if points < fewest:
        raise InvalidInput(
            "spacing",
            f"{points:.2f} nodes in the shortest wave",
            f"at least {fewest:g}: a finer grid or a lower frequency",
        )
    return place_elements(medium, np.atleast_2d(emitter)), place_elements(medium, receivers)


def place_elements(medium: Medium, positions: Floats) -> Points:
    """Elements on the medium's grid, with weights of its type."""
    points = points_at(positions, medium.spacing, medium.speed.shape, medium.margin)
    return Points(points.first, points.weights.astype(medium.keep.dtype))


def check_2d(medium: Medium) -> None:
    """Check that a medium is 2-D, where 3-D waves are not implemented.

    Raises:
        InvalidInput: for a 3-D medium, naming its shape.
    """
    if medium.speed.ndim != 2:
        raise InvalidInput("speed", f"shape {medium.speed.shape}", "(nx, ny)")


def points_per_wavelength(medium: Medium, wavelet: Floats) -> float:
    """Nodes per shortest wavelength of a wavelet."""
    if wavelet.ndim != 1 or wavelet.size < 2 or not np.isfinite(wavelet).all() or not wavelet.any():
        raise InvalidInput("wavelet", f"shape {wavelet.shape}", "(nt,) of finite numbers, not all 0")
    spectrum = np.abs(np.fft.rfft(wavelet, 2 * wavelet.size))
    frequency = np.fft.rfftfreq(2 * wavelet.size, medium.time_step_s)
    highest = float(frequency[spectrum >= BAND_EDGE * spectrum.max()].max())
    return float(medium.speed.min() / (max(highest, frequency[1]) * medium.spacing))


def forward(
    medium: Medium,
    source: Points,
    detectors: Points,
    wavelet: Floats,
    every: int,
    by: Unknown = "speed",
    spans: Spans | None = None,
    poll: Poll = no_poll,
    storage: NDArray[Any] | None = None,
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Traces, and the source of scattered waves in the image at every ``every``-th step.

    Args:
        source, detectors: as ``place_elements`` gives them.
        every: steps between stored fields; 0: store none.
        by: the variable whose change scatters.
        spans: the nodes that matter, see ``light_cone``; all by default, and for a 3-D medium.
        poll: see ``time_blocks``.
        storage: of the shape and type of ``scattered``, for reuse; fresh memory by default.

    Returns:
        traces: (nrx, nt).
        scattered: (ceil(nt / every), nx, ny), relative to the wavelet's maximum: h^2 (laplacian p + s), the
            source radiated by a change of 1/c^2, or next - before + 2 sigma dt now, by one of sigma dt. Empty
            for a 3-D medium.
    """
    kind = medium.keep.dtype
    nt = wavelet.size
    traces = np.zeros((len(detectors.first), nt), kind)
    fields = [zeros(medium.keep.shape, kind) for _ in range(2)]
    scale = float(np.abs(wavelet).max())
    taps, pulse = weights(medium.order).astype(kind), (wavelet / scale).astype(kind)
    shot = (*fields, medium.factors, taps, source, detectors, pulse, traces)
    blocks = split_steps(nt, medium.keep.size, poll)
    if medium.speed.ndim == 3:
        for begin, end in blocks:
            _forward_3d(begin, end, shot)
        # A point source is 1 / spacing^3 on its node; the factors contain spacing^2.
        traces *= kind.type(scale / medium.spacing)
        return traces, np.empty((0, *medium.speed.shape), kind)
    scattered = np.empty(*fields_of(medium, nt, every)) if storage is None else storage
    inner = tuple(slice(medium.margin, medium.margin + nodes) for nodes in medium.speed.shape)
    fade = medium.fade[inner]
    turn = (1 - fade) / (1 + fade)
    spans = everywhere(medium) if spans is None else spans
    storing = every, by == "attenuation", turn, scattered
    for begin, end in blocks:
        _forward(begin, end, shot, spans, medium.margin, storing)
    traces *= kind.type(scale)
    return traces, scattered


def fields_of(medium: Medium, nt: int, every: int) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of the stored fields of one emission in a plane, see ``forward``."""
    return (-(-nt // every) if every else 0, *medium.speed.shape), medium.keep.dtype


@kernel
def _forward(begin: int, end: int, shot: Any, spans: Any, margin: int, storing: Any) -> None:
    now, old, (keep, fade, drive), weights, source, detectors, wavelet, traces = shot
    every, by_loss, turn, scattered = storing
    first, along = source.first[0], source.weights[0]
    scratch = np.empty(now.shape[1], now.dtype)
    for n in range(begin, end):
        for r in range(traces.shape[0]):
            traces[r, n] = read(now, detectors.first[r], detectors.weights[r])
        part = spans[min(n // BLOCK_STEPS, spans.shape[0] - 1)]
        stored = every > 0 and n % every == 0
        if stored and not by_loss:
            into = scattered[n // every]
            advance_storing(now, old, keep, fade, drive, weights, part, margin, scratch, into)
            spread(into, margin, first, along, wavelet[n])
        else:
            if stored:
                begin_loss_scattering(now, old, turn, margin, scattered[n // every])
            advance(now, old, keep, fade, drive, weights, part)
        inject(old, drive, first, along, wavelet[n])
        if stored and by_loss:
            end_loss_scattering(old, margin, scattered[n // every])
        now, old = old, now


@kernel
def _forward_3d(begin: int, end: int, shot: Any) -> None:
    now, old, (keep, fade, drive), weights, source, detectors, wavelet, traces = shot
    for n in range(begin, end):
        for r in range(traces.shape[0]):
            traces[r, n] = read_3d(now, detectors.first[r], detectors.weights[r])
        advance_3d(now, old, keep, fade, drive, weights)
        inject_3d(old, drive, source.first[0], source.weights[0], wavelet[n])
        now, old = old, now
