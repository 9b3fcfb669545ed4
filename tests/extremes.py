"""Numbers that break arithmetic: huge, tiny, infinite and none at all."""

import math
import sys

# Floats that JSON cannot write are there too: Python reads and writes them.
FLOATS = (
    math.nan,
    math.inf,
    -math.inf,
    sys.float_info.max,
    -1e308,
    1e300,
    -1e300,
    1e39,
    sys.float_info.min,
    5e-324,
    -5e-324,
    -0.0,
)
INTEGERS = (10**400, -(10**400), 2**63, -(2**63) - 1, 2**31, -1, 0)
EXTREMES = (*INTEGERS, *FLOATS)
