"""Raw digitised traces of a scan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InvalidInput
from ..requests.limits import SCALE
from . import rules

Floats = NDArray[np.float64]

# Traces, and factors of each.
ARRAYS = ("object", "water", "object_scale", "water_scale")


@dataclass(frozen=True)
class Waveform:
    """Raw traces of the object scan and of the same scan in water alone.

    Attributes:
        object: (ntx, nrx, nt), with a leading nz axis for several slices; int16 or float32.
        water: as ``object``, or None. Masked samples of both become NaN, which leaves out their traces.
        scale: pressure per count; the traces are ``scale * object`` in pascal (or any one unit).
        object_scale, water_scale: (ntx, nrx), optional further factor per trace.
    """

    object: NDArray[np.int16] | NDArray[np.float32]
    water: NDArray[np.int16] | NDArray[np.float32] | None = None
    scale: float = 1.0
    object_scale: Floats | None = None
    water_scale: Floats | None = None

    def __post_init__(self) -> None:
        for name in ARRAYS:
            array = getattr(self, name)
            if isinstance(array, np.ma.MaskedArray):
                # A trace with a sample that is not finite is left out.
                kind = (
                    np.dtype(np.float32)
                    if np.ma.is_masked(array) and array.dtype.kind in "iu"
                    else array.dtype
                )
                empty = np.nan if kind.kind == "f" else 0
                object.__setattr__(self, name, np.ma.filled(array.astype(kind), empty))
        if not SCALE.holds(abs(self.scale)):
            raise InvalidInput("waveform@scale", self.scale, f"in size {SCALE.words}")
        if self.object.ndim not in (3, 4) or 0 in self.object.shape:
            raise InvalidInput(
                "waveform/object",
                f"shape {self.object.shape}",
                "(ntx, nrx, nt), or (nz, ntx, nrx, nt), none 0",
            )
        if self.water is not None:
            rules.shape("waveform/water", self.water, self.object.shape)
        for name, scale in (("object_scale", self.object_scale), ("water_scale", self.water_scale)):
            if scale is not None:
                rules.shape(f"waveform/{name}", scale, self.object.shape[:-1])
                rules.no_infinity(f"waveform/{name}", scale)

    @property
    def water_traces(self) -> Any:
        """The traces of a scan that must have a water shot."""
        assert self.water is not None
        return self.water

    def changed(self, change: Callable[[Any], Any]) -> Waveform:
        """These traces with all arrays changed in the same way."""
        arrays = {name: getattr(self, name) for name in ARRAYS}
        return replace(self, **{name: change(array) for name, array in arrays.items() if array is not None})
