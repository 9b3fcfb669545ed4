"""Smoothing of pictures of glass where neighbouring rays take other paths, so that their colours are noise.

At such pixels post-refraction supersampling has no neighbours to interpolate between (4.3.3), and each
further ray costs as much as the first one. A low-pass over the neighbours needs none.
"""

import numpy as np
from numpy.typing import NDArray

from ..compilation.compiled import kernel
from .backdrop import Colours

# Neighbours of eight that differ from a pixel at an edge, and within many edges, which are smoothed twice.
AT_EDGE, AMONG_EDGES = 1, 4


@kernel
def smooth_edges(values: NDArray[np.int16], least: int, image: Colours) -> None:
    """Replace pixels at edges by the mean of their 3 × 3 pixels, with weights 1, 2, 1 along both sides.

    Args:
        values: (rows, columns, k) of the pixels.
        least: difference of one of the k values from which a neighbour differs.
        image: (rows, columns, 3), changed.
    """
    rows, columns, depth = values.shape
    differing = np.zeros((rows, columns), dtype=np.uint8)
    for i in range(rows):
        for j in range(columns):
            for p in range(max(i - 1, 0), min(i + 2, rows)):
                for q in range(max(j - 1, 0), min(j + 2, columns)):
                    for c in range(depth):
                        if abs(int(values[p, q, c]) - int(values[i, j, c])) >= least:
                            differing[i, j] += 1
                            break
    for fewest in (AT_EDGE, AMONG_EDGES):
        before = image.copy()
        for i in range(rows):
            for j in range(columns):
                if differing[i, j] < fewest:
                    continue
                for c in range(3):
                    total = 8
                    for a in range(-1, 2):
                        for b in range(-1, 2):
                            p, q = min(max(i + a, 0), rows - 1), min(max(j + b, 0), columns - 1)
                            total += (2 - abs(a)) * (2 - abs(b)) * before[p, q, c]
                    image[i, j, c] = total // 16
