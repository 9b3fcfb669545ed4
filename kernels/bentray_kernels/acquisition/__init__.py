"""What a ring scanner recorded, and the first arrivals read from it."""

from .dataset import Dataset, Truth, Waveform
from .picking import PICKERS, pick
from .water import speed_from_temperature, temperature_from_speed

__all__ = [
    "PICKERS",
    "Dataset",
    "Truth",
    "Waveform",
    "pick",
    "speed_from_temperature",
    "temperature_from_speed",
]
