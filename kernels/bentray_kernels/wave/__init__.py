"""Acoustic waves: a finite-difference simulator in 2-D and 3-D, and its adjoint (3-D on devices)."""

from .adjoint import MisfitGradient, misfit_gradient
from .emissions import Emissions, misfit_gradients, simulate_emissions
from .medium import Medium
from .memory import emission_bytes
from .simulation import simulate

__all__ = [
    "Emissions",
    "Medium",
    "MisfitGradient",
    "emission_bytes",
    "misfit_gradient",
    "misfit_gradients",
    "simulate",
    "simulate_emissions",
]
