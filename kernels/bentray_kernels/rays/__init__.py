"""Rays from receivers back to the source, and the nodes they pass."""

from .sensitivity import sensitivities
from .tracing import trace

__all__ = ["sensitivities", "trace"]
