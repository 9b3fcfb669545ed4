"""Sensitivities of travel times to the slowness of the nodes: metres of ray, as a sparse matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from ..arrays import Floats, Ints
from ..compilation.compiled import kernel
from ..requests.names import RayGradient
from .descent import PARTS, STEP, empty_path, list_entries, merge_entries, trace_ray
from .fan import Fan, RayKind


def sensitivities(
    tof: ArrayLike,
    spacing: float,
    receivers: ArrayLike,
    source: ArrayLike,
    *,
    kind: RayKind = "curved",
    gradient: RayGradient = "differences",
) -> csr_array:
    """Length of each ray attributed to each node, the weights w of SART (chapter 6, equation 1).

    By Fermat's principle the first-order change of a travel time is Σ w·δslowness along the unperturbed
    ray, and Σ w·slowness is the travel time as the integral of the slowness along the ray.

    Args:
        tof, spacing, receivers, source, kind, gradient: as ``trace``.

    Returns:
        (receivers, nodes), m; columns are nodes in C order. Rows sum to the length of the ray; each node
        appears once in a row, in the order in which the ray passes.

    Raises:
        InvalidInput: as ``trace``.
    """
    fan = Fan.checked(tof, spacing, receivers, source, kind, gradient)
    pointers, columns, lengths = _rows(fan)
    return csr_array((lengths * spacing, columns, pointers), shape=(len(fan.receivers), fan.tof.size))


@kernel
def _rows(fan: Fan) -> tuple[Ints, Ints, Floats]:
    """Pointers, columns and lengths, nodes, of the compressed sparse rows."""
    path, scratch = empty_path(fan)
    nodes = np.empty((PARTS * len(path)) << len(fan.shape), np.int64)
    lengths = np.empty(nodes.size)
    total = np.zeros(fan.tof.size)
    rays = len(fan.receivers)
    pointers = np.zeros(rays + 1, np.int64)
    capacity = max(16, rays * 4 * sum(fan.shape))
    columns = np.empty(capacity, np.int64)
    values = np.empty(capacity)
    filled = 0
    for row in range(rays):
        count = trace_ray(fan, row, STEP, path, scratch)
        entries = list_entries(fan, path, count, PARTS, nodes, lengths, scratch)
        while filled + entries > capacity:
            columns = np.concatenate((columns, np.empty(capacity, np.int64)))
            values = np.concatenate((values, np.empty(capacity)))
            capacity *= 2
        filled = merge_entries(nodes, lengths, entries, total, columns, values, filled)
        pointers[row + 1] = filled
    return pointers, columns[:filled], values[:filled]
