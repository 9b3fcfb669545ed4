"""Calibration from the water shot: element positions, delays and water speed."""

from .adjustment import calibrate
from .result import Calibration
from .water_times import water_times

__all__ = ["Calibration", "calibrate", "water_times"]
