"""The fast iterative method on an OpenCL device, or on the CPU where no device passes its self-test."""

from collections.abc import Sequence

import numpy as np

from ..arrays import Floats
from ..opencl import computing_on, session_or_warning
from ..opencl.blocks import travel_times
from .fast_iterative import fast_iterative
from .problem import PointSource, check_tolerance


def fast_iterative_opencl(
    problems: Sequence[PointSource], times: Floats, *, tolerance: float = 1e-12
) -> None:
    """Travel times by blocks of points advanced in an OpenCL device's local memory (chapter 7.2.2).

    Args:
        problems: as many checked problems of one shape and spacing as the batch of ``times``; they share the
            launches, and each result is bit-for-bit that of a single solve.
        times: (batch, nx, ny[, nz]), s, C order; filled, equal to ``fim`` up to the tolerance.
        tolerance: as in ``fim``.

    Raises:
        InvalidInput: for a negative tolerance, or a ``BENTRAY_OPENCL_DEVICE`` that does not match one device.
        DeviceLostError: when the device fails.

    Warns:
        OpenCLFallbackWarning: once, where no device passes its self-test and ``fim`` computes instead.
    """
    check_tolerance(tolerance)
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
