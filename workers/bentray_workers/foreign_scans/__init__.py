"""Scans in the formats of others: MATLAB 5 and 7.3, NumPy archives, k-Wave; told apart by their content."""

from .conversion import convert_dataset

__all__ = ["convert_dataset"]
