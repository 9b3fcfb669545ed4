"""Rays from receivers back to the source, the nodes they pass, and the time along them."""

from .sensitivity import sensitivities
from .tracing import trace
from .travel_time import travel_times

__all__ = ["sensitivities", "trace", "travel_times"]
