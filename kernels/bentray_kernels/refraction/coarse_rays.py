"""Pictures from fewer rays than pixels: where rays end is interpolated between them, for fast previews."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..compilation.compiled import kernel


class Hits(NamedTuple):
    """Where rays or pixels end, (n, m) each, as in ``render.Picture``; ``where`` in edges of the plane."""

    plane: NDArray[np.int8]
    where: Floats
    fate: NDArray[np.uint8]
    crossed: NDArray[np.int16]
    weight: Floats


@kernel
def interpolate_rays(spacing: int, rays: Hits, pixels: Hits) -> None:
    """The results of all pixels from those of every ``spacing``-th ray along both sides.

    A ray is at the centre of a square of ``spacing`` × ``spacing`` pixels. A pixel takes place and weight
    bilinearly from the four rays around it that belong to the piece of the picture of its nearest ray, i.e.
    met as many interfaces and ended on the same plane; all else from its nearest ray.

    Args:
        spacing: pixels between rays, at least 1.
        rays: (n, m).
        pixels: (rows, columns), at most (n, m)·spacing; filled.
    """
    planes, places, fates, crossed, weights = rays
    rows, columns = pixels.plane.shape
    for i in range(rows):
        p = i // spacing
        y = (i + 0.5) / spacing - 0.5
        above = int(np.floor(y))
        for j in range(columns):
            q = j // spacing
            x = (j + 0.5) / spacing - 0.5
            left = int(np.floor(x))
            pixels.plane[i, j], pixels.fate[i, j] = planes[p, q], fates[p, q]
            pixels.crossed[i, j] = crossed[p, q]
            total = u = v = weight = 0.0
            for down in range(2):
                for right in range(2):
                    a = min(max(above + down, 0), len(planes) - 1)
                    b = min(max(left + right, 0), planes.shape[1] - 1)
                    if planes[a, b] != planes[p, q] or crossed[a, b] != crossed[p, q]:
                        continue
                    share = (1.0 - abs(y - above - down)) * (1.0 - abs(x - left - right))
                    total += share
                    u += share * places[a, b, 0]
                    v += share * places[a, b, 1]
                    weight += share * weights[a, b]
            pixels.where[i, j, 0], pixels.where[i, j, 1] = u / total, v / total
            pixels.weight[i, j] = weight / total
