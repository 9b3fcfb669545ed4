"""Acoustic waves: a finite-difference simulator in 2-D and 3-D, and its adjoint in 2-D."""

from .adjoint import MisfitGradient, misfit_gradient
from .medium import Medium
from .memory import emission_bytes
from .simulation import simulate

__all__ = ["Medium", "MisfitGradient", "emission_bytes", "misfit_gradient", "simulate"]
