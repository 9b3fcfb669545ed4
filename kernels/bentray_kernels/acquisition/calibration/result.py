"""Result of a calibration, each value with its standard deviation."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...arrays import Floats
from ..dataset import Dataset


@dataclass(frozen=True)
class Calibration:
    """Calibrated elements and water speed.

    Positions keep the nominal centroid and orientation, and with a fitted speed the size; delays of emission
    and of reception each have mean 0, the rest is the common delay. Elements without pairs are unchanged,
    with standard deviation NaN.

    Attributes:
        element_position_m: (elements, 2), m.
        position_sigma_m: as above.
        emission_delay_s: (ntx,), s; positive where an emitter is late.
        emission_sigma_s: as above.
        reception_delay_s, reception_sigma_s: (nrx,), s.
        common_delay_s: of all pairs, s: start of the recording and the pulse's own delay.
        water_speed_mps: m/s.
        water_speed_sigma_mps: 0 where the speed was given.
        residual_rms_s: of the pairs used, s.
        pairs: number of pairs used.
        left_out: number of pairs with too large a residual.
    """

    element_position_m: Floats
    position_sigma_m: Floats
    emission_delay_s: Floats
    emission_sigma_s: Floats
    reception_delay_s: Floats
    reception_sigma_s: Floats
    common_delay_s: float
    water_speed_mps: float
    water_speed_sigma_mps: float
    residual_rms_s: float
    pairs: int
    left_out: int

    def applied(self, dataset: Dataset) -> Dataset:
        """The dataset with these positions and this water speed; delays cancel in object minus water."""
        return replace(
            dataset,
            element_position_m=self.element_position_m,
            water_speed_mps=self.water_speed_mps,
            water_temperature_c=dataset.water_temperature_c if self.water_speed_sigma_mps == 0.0 else None,
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON, None for NaN."""
        values: dict[str, Any] = {}
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                values[name] = np.where(np.isfinite(value), value.astype(object), None).tolist()  # type: ignore[call-overload]
            else:
                values[name] = value
        return values
