"""What a ring scanner recorded, and the first arrivals read from it."""

from .dataset import Dataset, Truth, Waveform

__all__ = ["Dataset", "Truth", "Waveform"]
