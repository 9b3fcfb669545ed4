"""Arrays whose rows begin on cache lines: vector loads that cross two of them take twice as long."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .stencil import HALO

# Bytes of a line; single-precision nodes of a line.
LINE = 64
LINE_NODES = LINE // 4


def missing(nodes: int) -> int:
    """Nodes that a row lacks to whole lines."""
    return -nodes % LINE_NODES


def zeros(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Zeros in C order; the node after the halo begins a line in every row of whole lines."""
    kind = np.dtype(dtype)
    size = int(np.prod(shape)) * kind.itemsize
    memory = np.zeros(size + LINE, np.uint8)
    skipped = -(memory.ctypes.data + HALO * kind.itemsize) % LINE
    return memory[skipped : skipped + size].view(kind).reshape(shape)
