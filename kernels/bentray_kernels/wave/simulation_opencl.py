"""Pressure traces of one emitter by OpenCL, or by the CPU where no device passes its self-test."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from .medium import Medium
from .points import REACH, Points
from .simulation import check_2d, forward, place_scan
from .stencil import HALO, weights
from .time_step import FLUSH

if TYPE_CHECKING:
    from ..opencl.session import Session


def simulate_opencl(medium: Medium, emitter: Floats, receivers: Floats, wavelet: Floats) -> Floats:
    """As ``simulate``, from the same stencil, factors and weights; equal to it except for rounding.

    Raises:
        InvalidInput: as ``simulate``, for a 3-D medium, and where ``BENTRAY_OPENCL_DEVICE`` does not
            match one device.

    Warns:
        OpenCLFallbackWarning: once, where no device passes its self-test and ``simulate`` computes instead.
    """
    # Imported here, so that OpenCL is loaded only when it is used.
    from ..opencl.choice import session_or_warning

    check_2d(medium)
    source, detectors = place_scan(medium, emitter, receivers, wavelet)
    session = session_or_warning(instead="simulate")
    if session is None:
        return forward(medium, source, detectors, wavelet, 0)[0]
    return _simulated(session, medium, source, detectors, wavelet)


def _simulated(
    session: Session, medium: Medium, source: Points, detectors: Points, wavelet: Floats
) -> Floats:
    from ..opencl.session import set_arguments

    kind = medium.keep.dtype
    taps = 2 * REACH
    defines = (f"REAL={'float' if kind == np.float32 else 'double'}", f"HALO={HALO}", f"TAPS={taps}")
    advance, inject, record = (
        session.kernel(("wave/step",), name, *defines) for name in ("advance", "inject", "record")
    )
    nx, ny = medium.keep.shape
    row, steps, count = np.uint32(ny), np.uint32(wavelet.size), len(detectors.first)
    scale = float(np.abs(wavelet).max())
    traces = np.empty((count, wavelet.size), kind)
    with session.lock:
        fields = [session.upload(np.zeros((nx, ny), kind)) for _ in range(2)]
        keep, fade, drive = (session.upload(part) for part in (medium.keep, medium.fade, medium.drive))
        stencil = session.upload(weights().astype(kind))
        pulse = session.upload((wavelet / scale).astype(kind))
        at, along = session.upload(source.first[0].astype(np.int32)), session.upload(source.weights[0])
        first, by_tap = session.upload(detectors.first.astype(np.int32)), session.upload(detectors.weights)
        samples = session.reserve(traces.nbytes)
        for n in range(wavelet.size):
            now, old = fields[n % 2], fields[1 - n % 2]
            step = np.uint32(n)
            set_arguments(record, now, first, by_tap, samples, step, steps, row)
            session.launch(record, (count,), None)
            set_arguments(advance, now, old, keep, fade, drive, stencil, kind.type(FLUSH), row)
            session.launch(advance, (ny - 2 * HALO, nx - 2 * HALO), None)
            set_arguments(inject, old, drive, at, along, pulse, step, row)
            session.launch(inject, (taps, taps), None)
        session.download(traces, samples)
    traces *= kind.type(scale)
    return traces
