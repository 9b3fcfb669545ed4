"""Sound speed and attenuation from travel times, along straight or bent rays."""

from .errors_against_truth import mean_absolute_error, rmse
from .problem import Problem
from .reconstruct import reconstruct
from .result import RESIDUAL_EDGES_S, Progress, Reconstruction, Sweep, Trial
from .settings import Settings

__all__ = [
    "RESIDUAL_EDGES_S",
    "Problem",
    "Progress",
    "Reconstruction",
    "Settings",
    "Sweep",
    "Trial",
    "mean_absolute_error",
    "reconstruct",
    "rmse",
]
