"""Delay and sum of analytic signals over emitters and receivers, with an aperture of opening angles."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Flags, Float32s, Floats, Ints
from ...compilation.compiled import kernel
from .element_times import ElementTimes, Views, view_pixels

# Pairs whose rays make a larger angle at a pixel are left out, degrees; the weight of a pair falls with its
# cosine, from 1 for an echo straight back to 0.
PAIR_ANGLE_DEG = 90.0

# Pixels of a side of a tile: its views of all receivers stay in the cache.
TILE = 16


class Signals(NamedTuple):
    """Analytic signals of some emissions.

    Attributes:
        parts: (emissions, receivers, 2, samples), real and imaginary parts, float32; the outer samples are 0.
        used: (emissions, receivers), pairs that are summed.
        first_s: travel time of sample 0, s: its time less the delay of the pulse.
        rate_hz: of the samples.
    """

    parts: Float32s
    used: Flags
    first_s: float
    rate_hz: float


class Pixels(NamedTuple):
    """The grid of the image, in nodes of the speed.

    Attributes:
        start: (2,), pixel 0.
        step: from pixel to pixel.
        inside: (nx, ny), pixels that are imaged.
    """

    start: Floats
    step: float
    inside: Flags


class Sums(NamedTuple):
    """Sums over emissions, each (nx, ny).

    Attributes:
        echo: b(x) = Σ b_e(x), complex64, with b_e of ``sum_echoes``.
        power: Σ |b_e|², float32.
        weight: Σ w over all pairs, float32.
    """

    echo: NDArray[np.complex64]
    power: Float32s
    weight: Float32s


def empty_sums(shape: tuple[int, ...]) -> Sums:
    """Sums of no emission."""
    zeros = np.zeros(shape, dtype=np.float32)
    return Sums(np.zeros(shape, dtype=np.complex64), zeros, zeros.copy())


def sum_echoes(
    signals: Signals,
    times: ElementTimes,
    spacing: float,
    emitters: Ints,
    receivers: Ints,
    pixels: Pixels,
    pair_angle_deg: float,
) -> Sums:
    """Sums over some emissions; those of several groups are added in the order of the emitters.

    For each emitter e and pixel x, with the analytic signals a and the travel times T along bent rays,

        b_e(x) = Σ_r w(θ) a_er(T(e, x) + T(r, x)),
        w(θ) = max(0, (cos θ − cos θ_max) / (1 − cos θ_max)).

    θ is the angle at x between the rays from e and from r: 0 for an echo that returns where it came from.
    Signals are read by linear interpolation.

    Args:
        signals: of the emissions.
        times: of all elements.
        spacing: of the speed's nodes, m.
        emitters: (emissions,), index in ``times`` of each emitter.
        receivers: (receivers,), the same.
        pixels: of the image.
        pair_angle_deg: θ_max.
    """
    sums = empty_sums(pixels.inside.shape)
    cosine = math.cos(math.radians(pair_angle_deg))
    _sum_tiles(signals, times, spacing, emitters, receivers, pixels, cosine, sums)
    return sums


@kernel
def _sum_tiles(
    signals: Signals,
    times: ElementTimes,
    spacing: float,
    emitters: Ints,
    receivers: Ints,
    pixels: Pixels,
    least: float,
    sums: Sums,
) -> None:
    size = TILE * TILE
    px, py = np.empty(size), np.empty(size)
    column, row = np.empty(size, np.int64), np.empty(size, np.int64)
    of_emitters, of_receivers = _empty_views(len(emitters), size), _empty_views(len(receivers), size)
    weight, real, imaginary = (
        np.empty(size, np.float32),
        np.empty(size, np.float32),
        np.empty(size, np.float32),
    )
    total = np.empty(size, np.float32)
    scale = np.float32(1.0 / (1.0 - least))
    nx, ny = pixels.inside.shape
    for i in range(0, nx, TILE):
        for j in range(0, ny, TILE):
            count = 0
            for m in range(i, min(i + TILE, nx)):
                for n in range(j, min(j + TILE, ny)):
                    if pixels.inside[m, n]:
                        column[count], row[count] = m, n
                        px[count] = pixels.start[0] + pixels.step * m
                        py[count] = pixels.start[1] + pixels.step * n
                        count += 1
            if count == 0:
                continue
            view_pixels(times, emitters, spacing, px, py, count, of_emitters)
            view_pixels(times, receivers, spacing, px, py, count, of_receivers)
            for e in range(len(emitters)):
                real[:count], imaginary[:count], total[:count] = 0.0, 0.0, 0.0
                for r in range(len(receivers)):
                    if not signals.used[e, r]:
                        continue
                    largest = _weigh(of_emitters, e, of_receivers, r, count, np.float32(least), scale, weight)
                    if largest > 0.0:
                        _add_echo(
                            signals, e, r, of_emitters, of_receivers, count, weight, real, imaginary, total
                        )
                for p in range(count):
                    m, n = column[p], row[p]
                    sums.echo[m, n] += np.complex64(complex(real[p], imaginary[p]))
                    sums.power[m, n] += real[p] * real[p] + imaginary[p] * imaginary[p]
                    sums.weight[m, n] += total[p]


@kernel(inline="always")
def _weigh(
    sent: Views,
    e: int,
    received: Views,
    r: int,
    count: int,
    least: np.float32,
    scale: np.float32,
    weight: Float32s,
) -> np.float32:
    """Weights w(θ) of a pair at some pixels; returns the largest."""
    ex, ey, rx, ry = sent.x[e], sent.y[e], received.x[r], received.y[r]
    largest = np.float32(0.0)
    for p in range(count):
        cosine = ex[p] * rx[p] + ey[p] * ry[p]
        weight[p] = max(np.float32(0.0), (cosine - least) * scale)
        largest = max(largest, weight[p])
    return largest


@kernel(inline="always")
def _add_echo(
    signals: Signals,
    e: int,
    r: int,
    sent: Views,
    received: Views,
    count: int,
    weight: Float32s,
    real: Float32s,
    imaginary: Float32s,
    total: Float32s,
) -> None:
    """Add w a(T(e, x) + T(r, x)) of one pair at some pixels."""
    cosines, sines = signals.parts[e, r, 0], signals.parts[e, r, 1]
    to_pixel, back = sent.time[e], received.time[r]
    rate = np.float32(signals.rate_hz)
    first = np.float32(signals.first_s * signals.rate_hz)
    last = np.float32(cosines.size - 2)
    for p in range(count):
        place = rate * (to_pixel[p] + back[p]) - first
        place = min(max(place, np.float32(0.0)), last)
        k = np.uint32(place)
        part = place - np.float32(k)
        w = weight[p]
        real[p] += w * (cosines[k] + part * (cosines[k + np.uint32(1)] - cosines[k]))
        imaginary[p] += w * (sines[k] + part * (sines[k + np.uint32(1)] - sines[k]))
        total[p] += weight[p]


@kernel
def _empty_views(elements: int, pixels: int) -> Views:
    return Views(
        np.empty((elements, pixels), np.float32),
        np.empty((elements, pixels), np.float32),
        np.empty((elements, pixels), np.float32),
    )
