"""Where the elements are, how late they are, and how fast the water is, from the shot without an object."""

from .adjustment import calibrate
from .result import Calibration
from .water_times import water_times

__all__ = ["Calibration", "calibrate", "water_times"]
