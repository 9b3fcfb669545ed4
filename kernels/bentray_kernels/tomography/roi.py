"""The region of interest of a dataset, read at the nodes of an image."""

from functools import reduce

import numpy as np

from ..acquisition import Dataset
from ..arrays import Flags
from ..errors import InvalidInput


def inside(
    dataset: Dataset,
    shape: tuple[int, ...],
    spacing: float,
    origin: tuple[float, ...],
    height: float | None = None,
) -> Flags:
    """Mask of the image nodes inside the region of interest, by the nearest node of ``mask/roi``.

    ``mask/roi`` is given on the grid of the truth; nodes beyond that grid are outside.

    Args:
        dataset: with ``roi`` and ``truth``.
        shape, spacing, origin: of the image, nodes and m.
        height: z of a slice, m, for a 3-D region.

    Raises:
        InvalidInput: for a missing or empty region, or one that is not on the grid of the truth.
    """
    roi, truth = dataset.roi, dataset.truth
    if roi is None:
        raise InvalidInput("mask/roi", "nothing", "a region of interest, since the setting roi is true")
    order = None if truth is None else truth.order
    if truth is None or order is None or len(order) != roi.ndim or roi.shape != truth.sound_speed_mps.shape:
        raise InvalidInput(
            "mask/roi", f"an image of shape {roi.shape}", "an image on the grid of the truth, with axes named"
        )
    if not roi.any():
        raise InvalidInput("mask/roi", "no node", "a region of interest of at least one node")
    lines = [o + spacing * np.arange(n) for o, n in zip(origin, shape, strict=True)]
    if roi.ndim == 3 and len(shape) == 2:
        lines.append(np.array([height or 0.0]))
    nearest, covered = [], []
    for line, axis in zip(lines, order, strict=False):
        node = np.rint((line - truth.origin_m[axis]) / truth.spacing_m[axis]).astype(np.int64)
        nearest.append(np.clip(node, 0, roi.shape[axis] - 1))
        covered.append(node == nearest[-1])
    mask = roi.transpose(order)[np.ix_(*nearest)] & reduce(np.logical_and.outer, covered)
    if mask.ndim == 3 and len(shape) == 2:
        return np.asarray(mask[..., 0])
    # A 2-D region holds at all heights of a volume.
    return np.array(np.broadcast_to(mask if mask.ndim == len(shape) else mask[..., None], shape))
