"""The number types of compiled lookups: single precision and 32 bits, so that vectors hold more of them."""

from __future__ import annotations

from typing import Any

import numpy as np

# To the type checker they are any numbers: inside a kernel a float is what its arguments make it.
real: Any = np.float32
whole: Any = np.int32
