"""The region of interest of a dataset, read at the nodes of an image."""

from __future__ import annotations

import numpy as np

from ..acquisition import Dataset
from ..arrays import Flags
from ..errors import InvalidInput

ORDERS = {"x,y": (0, 1), "y,x": (1, 0), "x,y,z": (0, 1, 2), "z,y,x": (2, 1, 0), "y,x,z": (1, 0, 2)}


def inside(
    dataset: Dataset,
    shape: tuple[int, ...],
    spacing: float,
    origin: tuple[float, ...],
    height: float | None = None,
) -> Flags:
    """Nodes whose nearest node of ``mask/roi`` is set; what lies beyond that image is outside.

    The image of the region lies on the truth's grid.

    Args:
        dataset: with ``roi`` and ``truth``.
        shape, spacing, origin: of the image, nodes and m.
        height: z of a slice, m, for a region in space.

    Raises:
        InvalidInput: without a region or a node in it, or without the grid it lies on.
    """
    roi, truth = dataset.roi, dataset.truth
    if roi is None:
        raise InvalidInput("mask/roi", "nothing", "a region of interest, since the setting roi is true")
    order = None if truth is None else ORDERS.get(truth.axes.replace(" ", ""))
    if truth is None or order is None or len(order) != roi.ndim or roi.shape != truth.sound_speed_mps.shape:
        raise InvalidInput(
            "mask/roi", f"an image of shape {roi.shape}", "an image on the grid of the truth, with axes named"
        )
    if not roi.any():
        raise InvalidInput("mask/roi", "no node", "a region of interest of at least one node")
    lines = [o + spacing * np.arange(n) for o, n in zip(origin, shape, strict=True)]
    if roi.ndim == 3 and len(shape) == 2:
        lines.append(np.array([height or 0.0]))
    found = []
    for line, axis in zip(lines, order, strict=False):
        place = np.rint((line - truth.origin_m[axis]) / truth.spacing_m[axis]).astype(np.int64)
        within = (place >= 0) & (place < roi.shape[axis])
        found.append((np.clip(place, 0, roi.shape[axis] - 1), within))
    values = roi.transpose(order)[np.ix_(*(place for place, _ in found))]
    known = np.ones(values.shape, dtype=np.bool_)
    for axis, (_, within) in enumerate(found):
        known &= within.reshape([-1 if a == axis else 1 for a in range(values.ndim)])
    both = values & known
    if both.ndim == 3 and len(shape) == 2:
        return np.asarray(both[..., 0])
    # A region in a plane holds at all heights of a volume.
    return np.array(np.broadcast_to(both if both.ndim == len(shape) else both[..., None], shape))
