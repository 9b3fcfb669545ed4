"""Complex numbers in files that must hold real ones: how they are recognised, and what to do with them."""

from __future__ import annotations

from typing import Any

import numpy as np

from bentray_kernels.errors import InvalidInput

# Names of the parts in HDF5: of h5py, of MATLAB 7.3, and of other writers.
PARTS = (("r", "i"), ("real", "imag"), ("re", "im"), ("real", "imaginary"))
ACCEPTED = "of complex traces the real part; of IQ data the real part after modulation to the carrier"


def check_real(field: str, dtype: np.dtype[Any], accepted: str) -> None:
    """Raise InvalidInput for a complex type, also for one that is stored as a pair of parts."""
    names = tuple(name.lower() for name in dtype.names or ())
    if dtype.kind == "c" or names in PARTS:
        shown = f"complex{8 * dtype.itemsize}"
        raise InvalidInput(field, f"complex numbers ({shown})", f"{accepted}; {ACCEPTED}")
