"""Delay and sum on an OpenCL device: the sums of ``delay_and_sum``, pixel by pixel."""

import math

import numpy as np

from ...arrays import Ints
from ...opencl import Session, session_or_warning
from ...opencl.lost_device import computing_on
from ...opencl.program import Program
from .delay_and_sum import Pixels, Signals, Sums, empty_sums, sum_echoes
from .element_times import ElementTimes

PROGRAM = Program(("reflection/delay_and_sum",))

# Pixels of a work-group, and at once at most: the views of all elements at these lie on the device.
GROUP, PIXELS = 64, 2**15

# Of a view of a pixel from an element, and of a sum of a pixel, bytes.
VIEW_BYTES = SUM_BYTES = 16


def sum_echoes_opencl(
    signals: Signals,
    times: ElementTimes,
    spacing: float,
    emitters: Ints,
    receivers: Ints,
    pixels: Pixels,
    pair_angle_deg: float,
) -> Sums:
    """Sum echoes by ``sum_echoes`` on the chosen OpenCL device; compiled code if none passes its self-test.

    The sums have the same order, and differ by rounding: within 1e-4 of the largest. The same bits on every
    run of one device.

    Raises:
        DeviceLostError: when the device fails.

    Warns:
        OpenCLFallbackWarning: once, where no device passes its self-test.
    """
    session = session_or_warning(instead="compiled code")
    if session is None:
        return sum_echoes(signals, times, spacing, emitters, receivers, pixels, pair_angle_deg)
    with computing_on(session), session.lock:
        return _summed(session, signals, times, spacing, (emitters, receivers), pixels, pair_angle_deg)


def _summed(
    session: Session,
    signals: Signals,
    times: ElementTimes,
    spacing: float,
    pairs: tuple[Ints, Ints],
    pixels: Pixels,
    pair_angle_deg: float,
) -> Sums:
    column, row = np.nonzero(pixels.inside)
    sums = empty_sums(pixels.inside.shape)
    samples = signals.parts.shape[-1]
    emissions, elements = len(pairs[0]), len(times.place)
    parts, used = session.upload(signals.parts), session.upload(signals.used.astype(np.uint8))
    sent, back = (session.upload(np.ascontiguousarray(one, np.int32)) for one in pairs)
    places = session.upload(np.ascontiguousarray(times.place, np.float64))
    slowness = session.upload(times.slowness)
    at_once = min(PIXELS, _pixels_at_once(session, elements, emissions))
    least = math.cos(math.radians(pair_angle_deg))
    views = session.reserve(VIEW_BYTES * elements * at_once)
    found, total = session.reserve(SUM_BYTES * emissions * at_once), session.reserve(SUM_BYTES * at_once)
    of_elements = {
        "places": places,
        "slowness": slowness,
        "stored_x": np.int32(times.slowness.shape[1]),
        "stored_y": np.int32(times.slowness.shape[2]),
        "spacing": np.float64(spacing),
    }
    of_signals = {
        "signals": parts,
        "used": used,
        "emitters": sent,
        "receivers": back,
        "count": np.int32(len(pairs[1])),
        "samples": np.int32(samples),
        "rate": np.float32(signals.rate_hz),
        "first": np.float32(signals.first_s * signals.rate_hz),
        "least": np.float32(least),
        "scale": np.float32(1.0 / (1.0 - least)),
    }
    kernels = [session.kernel(PROGRAM, name) for name in ("view_pixels", "sum_receivers", "sum_emissions")]
    for start in range(0, len(column), at_once):
        where = slice(start, start + at_once)
        m, n = column[where], row[where]
        px, py = (first + pixels.step * index for first, index in zip(pixels.start, (m, n), strict=True))
        count, wide = np.int32(len(m)), -(-len(m) // GROUP) * GROUP
        # Setting an argument does not keep its buffer alive: the names do.
        there = session.upload(px), session.upload(py)
        kernels[0].set(**of_elements, px=there[0], py=there[1], pixels=count, views=views)
        session.launch(kernels[0], (wide, elements), (GROUP, 1))
        kernels[1].set(**of_signals, pixels=count, views=views, found=found)
        session.launch(kernels[1], (wide, emissions), (GROUP, 1))
        kernels[2].set(found=found, emissions=np.int32(emissions), pixels=count, sums=total)
        session.launch(kernels[2], (wide,), (GROUP,))
        result = np.empty((len(m), 4), np.float32)
        session.download(result, total)
        sums.echo[m, n] = result[:, 0] + 1j * result[:, 1]
        sums.power[m, n], sums.weight[m, n] = result[:, 2], result[:, 3]
    return sums


def _pixels_at_once(session: Session, elements: int, emissions: int) -> int:
    """Pixels whose views and sums fill no more than a quarter of the device, a multiple of a work-group."""
    largest = 8 * session.doubles_at_once() // max(VIEW_BYTES * elements, SUM_BYTES * emissions)
    return max(GROUP, largest // GROUP * GROUP)
