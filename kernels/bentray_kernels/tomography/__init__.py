"""Sound speed and attenuation from travel times, along straight or bent rays."""

from typing import TYPE_CHECKING

from .settings import (
    AttenuationSettings,
    GaussNewtonSettings,
    PickingSettings,
    Settings,
)

if TYPE_CHECKING:
    from .comparison import correlation, mean_absolute_error, rmse, structural_similarity
    from .problem import Problem
    from .reconstruction import reconstruct
    from .regions import RegionStatistics, RoundRegion, region_statistics, round_nodes
    from .result import RESIDUAL_EDGES_S, Candidate, Caution, Iteration, Progress, Reconstruction
else:
    MODULES = {
        "comparison": ("correlation", "mean_absolute_error", "rmse", "structural_similarity"),
        "problem": ("Problem",),
        "regions": ("RegionStatistics", "RoundRegion", "region_statistics", "round_nodes"),
        "reconstruction": ("reconstruct",),
        "result": ("RESIDUAL_EDGES_S", "Caution", "Progress", "Reconstruction", "Iteration", "Candidate"),
    }

    def __getattr__(name: str) -> object:
        """Compiled modules take seconds to load; the command line needs the settings alone for its help."""
        from importlib import import_module

        for module, names in MODULES.items():
            if name in names:
                return getattr(import_module(f".{module}", __name__), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__() -> list[str]:
        """The documentation is generated from this list."""
        return __all__


__all__ = [
    "RESIDUAL_EDGES_S",
    "AttenuationSettings",
    "Candidate",
    "Caution",
    "GaussNewtonSettings",
    "Iteration",
    "PickingSettings",
    "Problem",
    "Progress",
    "Reconstruction",
    "RegionStatistics",
    "RoundRegion",
    "Settings",
    "correlation",
    "mean_absolute_error",
    "reconstruct",
    "region_statistics",
    "rmse",
    "round_nodes",
    "structural_similarity",
]
