"""The fast iterative method on an OpenCL device, or on the CPU where no device passes its self-test."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Floats
from ..errors import InvalidInput
from .fast_iterative import fast_iterative
from .problem import PointSource


def fast_iterative_opencl(problem: PointSource, *, tolerance: float = 1e-12) -> Floats:
    """Travel time by blocks of points advanced in an OpenCL device's local memory (chapter 7.2.2).

    Args:
        problem: the checked problem.
        tolerance: as in ``fim``.

    Returns:
        (nx, ny[, nz]), s; equal to ``fim`` up to the tolerance.

    Raises:
        InvalidInput: for a negative tolerance, or a ``BENTRAY_OPENCL_DEVICE`` that does not match one device.
        DeviceLostError: when the device fails.

    Warns:
        OpenCLFallbackWarning: once, where no device passes its self-test and ``fim`` computes instead.
    """
    times = np.empty((1, *problem.slowness.shape))
    fast_iterative_opencl_many([problem], times, tolerance=tolerance)
    return np.asarray(times[0])


def fast_iterative_opencl_many(
    problems: Sequence[PointSource], times: Floats, *, tolerance: float = 1e-12
) -> None:
    """Like ``fast_iterative_opencl`` for several problems of one shape and spacing, in the same launches.

    Args:
        problems: as many as the batch of ``times``; each result is bit-for-bit that of a single solve.
        times: (batch, nx, ny[, nz]), s, C order; filled.
        tolerance: as in ``fim``.
    """
    if not tolerance >= 0.0:
        raise InvalidInput("tolerance", tolerance, "a number >= 0")
    # Imported here, so that OpenCL is loaded only when it is used.
    from ..opencl.blocks import travel_times
    from ..opencl.device_selection import session_or_warning
    from ..opencl.lost_device import computing_on

    session = session_or_warning(instead="fim")
    if session is None:
        for problem, into in zip(problems, times, strict=True):
            into[...] = fast_iterative(problem, tolerance=tolerance)
        return
    first = problems[0]
    same = all(
        problem.medium is first.medium or np.array_equal(problem.slowness, first.slowness)
        for problem in problems[1:]
    )
    fields = [first] if same else problems
    crossings = np.stack([problem.spacing * problem.slowness for problem in fields])
    seeds = []
    for problem in problems:
        nodes, starts = problem.seeds()
        indices = np.array(np.unravel_index(nodes, problem.padded_shape)) - 1
        seeds.append((np.ravel_multi_index(tuple(indices), problem.slowness.shape), starts))
    with computing_on(session):
        times[...] = travel_times(session, crossings, seeds, tolerance)
