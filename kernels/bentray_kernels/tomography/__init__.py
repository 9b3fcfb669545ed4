"""Sound speed (and later attenuation) from travel times, along straight or bent rays."""

from .problem import SliceProblem
from .quality import mean_absolute_error, rmse
from .reconstruction import reconstruct
from .result import Progress, Reconstruction, Sweep
from .settings import Settings

__all__ = [
    "Progress",
    "Reconstruction",
    "Settings",
    "SliceProblem",
    "Sweep",
    "mean_absolute_error",
    "reconstruct",
    "rmse",
]
