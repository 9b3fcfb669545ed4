"""Bent rays: paths, sensitivities of travel times, travel times along them, geometrical spreading."""

from .sensitivity import sensitivities
from .spreading import log_amplitudes, spreading
from .tracing import trace
from .travel_time import travel_times

__all__ = ["log_amplitudes", "sensitivities", "spreading", "trace", "travel_times"]
