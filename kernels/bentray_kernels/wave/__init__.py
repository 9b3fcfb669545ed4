"""Acoustic waves: a finite-difference simulator in 2-D and 3-D, and its adjoint in 2-D."""

from .adjoint import Slope, slope, stored_bytes
from .medium import Medium
from .memory import emission_bytes
from .simulation import simulate

__all__ = ["Medium", "Slope", "emission_bytes", "simulate", "slope", "stored_bytes"]
