"""Scans in foreign formats: MATLAB 5 and 7.3, NumPy archives, k-Wave; detected by content."""

from .conversion import convert_dataset

__all__ = ["convert_dataset"]
