"""True values of a phantom, for comparison with its image."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import refuse_mask
from ...errors import InvalidInput
from ...requests.limits import PLACE_M, SPACING_M, TRUE_SPEED_MPS
from .. import rules

Floats = NDArray[np.float64]

# Axis orders that can be permuted to x, y[, z]; any other text requires registration of the truth.
ORDERS = {"x,y": (0, 1), "y,x": (1, 0), "x,y,z": (0, 1, 2), "z,y,x": (2, 1, 0), "y,x,z": (1, 0, 2)}


@dataclass(frozen=True)
class Truth:
    """True values of a phantom, on nodes ``origin_m + index * spacing_m`` in (x, y[, z]) order."""

    sound_speed_mps: Floats
    spacing_m: tuple[float, ...]
    origin_m: tuple[float, ...]
    attenuation_np_m: Floats | None = None
    axes: str = "x,y"

    def __post_init__(self) -> None:
        refuse_mask("truth/sound_speed_mps", self.sound_speed_mps)
        refuse_mask("truth/attenuation_np_m", self.attenuation_np_m)
        speed, ndim = self.sound_speed_mps, self.sound_speed_mps.ndim
        if ndim not in (2, 3) or 0 in speed.shape:
            raise InvalidInput(
                "truth/sound_speed_mps", f"shape {speed.shape}", "(nx, ny) or (nx, ny, nz), none 0"
            )
        rules.positive_or_nan("truth/sound_speed_mps", speed)
        rules.within_or_nan("truth/sound_speed_mps", speed, TRUE_SPEED_MPS)
        if len(self.spacing_m) != ndim or not all(map(SPACING_M.holds, self.spacing_m)):
            accepted = f"{ndim} times {SPACING_M.words}, or one for all axes"
            raise InvalidInput("truth@spacing_m", self.spacing_m, accepted)
        if len(self.origin_m) != ndim or not all(map(PLACE_M.holds, self.origin_m)):
            raise InvalidInput("truth@origin_m", self.origin_m, f"{ndim} times {PLACE_M.words}")
        if self.attenuation_np_m is not None:
            rules.shape("truth/attenuation_np_m", self.attenuation_np_m, speed.shape)
            rules.no_infinity("truth/attenuation_np_m", self.attenuation_np_m)

    @property
    def order(self) -> tuple[int, ...] | None:
        """Axes of the arrays in the order x, y[, z]; None for others."""
        return ORDERS.get(self.axes.replace(" ", ""))
