"""The quantities of a reconstruction: unit, array in files, and words; a new one is added here first."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple

# How the file of a reconstruction names itself: here, to be known without loading what makes one.
FORMAT, VERSION = "bentray-reconstruction", "1.0"

QuantityName = Literal["speed", "coverage", "recovery", "uncertainty", "reflection", "attenuation"]


class Quantity(NamedTuple):
    """A quantity of a reconstruction.

    Attributes:
        unit: of its values; 1 of a fraction.
        array: its name in files.
        title: above its image.
        label: of its values, with the unit.
    """

    unit: str
    array: str
    title: str
    label: str


QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        "speed": Quantity("m/s", "speed_mps", "Sound speed", "sound speed (m/s)"),
        "coverage": Quantity("m", "coverage_m", "Coverage", "ray length per node (m)"),
        "recovery": Quantity("1", "recovery", "Resolution check", "recovered fraction of a checkerboard"),
        "uncertainty": Quantity(
            "m/s", "uncertainty_mps", "Uncertainty", "standard deviation of the speed (m/s)"
        ),
        "reflection": Quantity("dB", "reflection_db", "Reflection", "reflection (dB)"),
        "attenuation": Quantity(
            "Np/m", "attenuation_np_m", "Attenuation (experimental)", "attenuation (Np/m)"
        ),
    }
)
REFLECTION = QUANTITIES["reflection"].array
# The attenuation over the frequency, which exports may hold in place of that at it.
ATTENUATION_DB = "attenuation_db_cm_mhz"
# Units by names of arrays.
UNITS = {**{row.array: row.unit for row in QUANTITIES.values()}, ATTENUATION_DB: "dB/(cm.MHz)"}
# The arrays on the nodes of the speed; the reflection has pixels of its own.
IMAGES = {name: quantity.array for name, quantity in QUANTITIES.items() if quantity.array != REFLECTION}
