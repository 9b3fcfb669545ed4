"""Rays from receivers back to the source, the nodes they pass, the time along them and how they spread."""

from .sensitivity import sensitivities
from .spreading import log_amplitudes, spreading
from .tracing import trace
from .travel_time import travel_times

__all__ = ["log_amplitudes", "sensitivities", "spreading", "trace", "travel_times"]
