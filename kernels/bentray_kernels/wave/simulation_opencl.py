"""Pressure traces of one emitter from an OpenCL device, or from the CPU where no device can be trusted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from .medium import Medium
from .points import REACH, Points
from .simulation import check_flat, forward, placed
from .stencil import HALO, weights
from .time_step import QUIET

if TYPE_CHECKING:
    from ..opencl.session import Session


def simulate_opencl(medium: Medium, emitter: Floats, receivers: Floats, wavelet: Floats) -> Floats:
    """As ``simulate``, from the same stencil, factors and weights; equal to it but for rounding.

    Raises:
        InvalidInput: as ``simulate``, for a medium in space, and where ``BENTRAY_OPENCL_DEVICE`` names no
            one device.

    Warns:
        OpenCLFallbackWarning: once, where no device passes its trial and ``simulate`` computes instead.
    """
    # Here, so that whoever never asks for OpenCL never loads it.
    from ..opencl.choice import session_or_warning

    check_flat(medium)
    source, heard = placed(medium, np.atleast_2d(emitter), wavelet), placed(medium, receivers)
    session = session_or_warning(instead="simulate")
    if session is None:
        return forward(medium, source, heard, wavelet, 0)[0]
    return _simulated(session, medium, source, heard, wavelet)


def _simulated(session: Session, medium: Medium, source: Points, heard: Points, wavelet: Floats) -> Floats:
    from ..opencl.session import set_arguments

    kind = medium.keep.dtype
    taps = 2 * REACH
    defines = (f"REAL={'float' if kind == np.float32 else 'double'}", f"HALO={HALO}", f"TAPS={taps}")
    advance, inject, listen = (
        session.kernel(("wave/step",), name, *defines) for name in ("advance", "inject", "listen")
    )
    nx, ny = medium.keep.shape
    row, steps, count = np.uint32(ny), np.uint32(wavelet.size), len(heard.first)
    scale = float(np.abs(wavelet).max())
    traces = np.empty((count, wavelet.size), kind)
    with session.lock:
        fields = [session.upload(np.zeros((nx, ny), kind)) for _ in range(2)]
        keep, fade, drive = (session.upload(part) for part in (medium.keep, medium.fade, medium.drive))
        stencil = session.upload(weights().astype(kind))
        pulse = session.upload((wavelet / scale).astype(kind))
        at, along = session.upload(source.first[0].astype(np.int32)), session.upload(source.weights[0])
        ears, hearing = session.upload(heard.first.astype(np.int32)), session.upload(heard.weights)
        given = session.reserve(traces.nbytes)
        for n in range(wavelet.size):
            now, old = fields[n % 2], fields[1 - n % 2]
            step = np.uint32(n)
            set_arguments(listen, now, ears, hearing, given, step, steps, row)
            session.launch(listen, (count,), None)
            set_arguments(advance, now, old, keep, fade, drive, stencil, kind.type(QUIET), row)
            session.launch(advance, (ny - 2 * HALO, nx - 2 * HALO), None)
            set_arguments(inject, old, drive, at, along, pulse, step, row)
            session.launch(inject, (taps, taps), None)
        session.download(traces, given)
    traces *= kind.type(scale)
    return traces
