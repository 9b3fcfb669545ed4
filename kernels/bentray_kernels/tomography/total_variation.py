"""The name under which the callers still know the linear problem."""

from .linear import Linearised

__all__ = ["Linearised"]
