"""Log amplitude ratios as line integrals of the attenuation along the bent rays of first arrivals."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...rays import sensitivities


def log_ratios(
    tof: Floats,
    attenuation: Floats,
    spacing: float,
    receivers: Floats,
    source: Floats,
    coupling_np_m: float = 0.0,
) -> Floats:
    """ln(A_water / A_object) of the arrivals from one source (the data of phase 2, chapter 6.3).

    Absorption only: ∫ α ds along the bent ray minus α_water times the straight distance. Focusing by
    refraction is not included.

    Args:
        tof: (nx, ny[, nz]), s, from the source.
        attenuation: as ``tof``, Np/m.
        spacing: node spacing, m.
        receivers: (k, ndim), m, in the grid; node 0 lies at 0.
        source: (ndim,), m.
        coupling_np_m: attenuation of the water of the scan without the object, Np/m.

    Returns:
        (k,), Np.

    Raises:
        InvalidInput: as ``rays.trace``.
    """
    through_object = sensitivities(tof, spacing, receivers, source) @ attenuation.ravel()
    straight = np.linalg.norm(receivers - source, axis=1)
    return np.asarray(through_object - coupling_np_m * straight)
