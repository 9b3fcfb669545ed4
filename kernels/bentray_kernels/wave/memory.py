"""What the waves of one emission take in memory, known before any of it is taken."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import DTypeLike

from ..errors import InvalidInput
from .stencil import HALO

# Bytes a padded node while a medium is made, beside its own factors: what those are worked out from.
MAKING = 40


def padded_nodes(shape: Sequence[int], edge_nodes: int) -> int:
    """Of an image with its edges and halo."""
    return math.prod(nodes + 2 * (edge_nodes + HALO) for nodes in shape)


def emission_bytes(shape: Sequence[int], edge_nodes: int, dtype: DTypeLike = np.float32) -> int:
    """Bytes that a medium takes while it is made, or later with the two fields, whichever is more.

    Beyond the image's own, and the traces'.

    Args:
        shape: of the image, two or three numbers of nodes.
        edge_nodes: width of the absorbing edges, nodes.
        dtype: of the fields.
    """
    real = np.dtype(dtype).itemsize
    return max(MAKING + 2 * real, 5 * real) * padded_nodes(shape, edge_nodes)


def check_room(shape: Sequence[int], edge_nodes: int, dtype: DTypeLike, room_bytes: float) -> None:
    """Refuse what takes more than there is.

    Raises:
        InvalidInput: naming the bytes of both.
    """
    takes = emission_bytes(shape, edge_nodes, dtype)
    if takes > room_bytes:
        nodes = " x ".join(str(one) for one in shape)
        raise InvalidInput(
            "speed", f"{nodes} nodes, which take {takes} bytes", f"what takes at most {room_bytes:.0f} bytes"
        )
