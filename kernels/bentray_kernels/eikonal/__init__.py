"""Travel times of a wave front: the Eikonal equation |∇T| = 1/speed from a point source."""

from .registry import METHODS, Method, methods, solve, solve_many

__all__ = ["METHODS", "Method", "methods", "solve", "solve_many"]
