"""Scans of ring transducers: datasets, and picking of first arrivals."""

from typing import TYPE_CHECKING

from .dataset import Dataset, Truth, Waveform
from .water import speed_from_temperature, temperature_from_speed

if TYPE_CHECKING:
    from .picking.first_arrivals import PICKERS, pick
else:

    def __getattr__(name: str) -> object:
        """Import picking on first use: it is slow to load, and checks of uploads do not need it."""
        if name not in ("PICKERS", "pick"):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from .picking import first_arrivals

        return getattr(first_arrivals, name)


__all__ = [
    "PICKERS",
    "Dataset",
    "Truth",
    "Waveform",
    "pick",
    "speed_from_temperature",
    "temperature_from_speed",
]
