"""Single precision and 32-bit integers for compiled lookups: vectors hold more of them."""

from typing import Any

import numpy as np

from .compiled import kernel

# To the type checker they are any numbers: inside a kernel a float is what its arguments make it.
real: Any = np.float32
whole: Any = np.int32


@kernel(inline="always")
def lower(a: float, b: float) -> float:
    """The smaller one; without the care for NaN that keeps loops from being vectorised."""
    return a if a < b else b


@kernel(inline="always")
def higher(a: float, b: float) -> float:
    """The larger one; as ``lower``."""
    return a if a > b else b
