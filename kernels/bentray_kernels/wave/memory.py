"""Memory of the simulation of one emission, estimated before it is allocated."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import DTypeLike

from ..errors import InvalidInput
from .cache_lines import missing
from .stencil import HALO

# Bytes per padded node of the intermediate arrays while a medium is built.
MAKING = 40


def padded_nodes(shape: Sequence[int], edge_nodes: int) -> int:
    """Number of nodes of an image with its edges and halo."""
    padded = [nodes + 2 * (edge_nodes + HALO) for nodes in shape]
    if len(padded) == 2:
        padded[1] += missing(padded[1])
    return math.prod(padded)


def emission_bytes(shape: Sequence[int], edge_nodes: int, dtype: DTypeLike = np.float32) -> int:
    """Bytes of a medium while it is built, or later with the two fields, whichever is more.

    The image itself and the traces are not included.

    Args:
        shape: of the image, two or three numbers of nodes.
        edge_nodes: width of the absorbing edges, nodes.
        dtype: of the fields.
    """
    real = np.dtype(dtype).itemsize
    return max(MAKING + 2 * real, 5 * real) * padded_nodes(shape, edge_nodes)


def check_memory(shape: Sequence[int], edge_nodes: int, dtype: DTypeLike, memory_bytes: float) -> None:
    """Raise if a simulation exceeds a memory limit.

    Raises:
        InvalidInput: naming the bytes of both.
    """
    takes = emission_bytes(shape, edge_nodes, dtype)
    if takes > memory_bytes:
        nodes = " x ".join(str(count) for count in shape)
        raise InvalidInput("speed", f"{nodes} nodes, {takes} bytes", f"at most {memory_bytes:.0f} bytes")
