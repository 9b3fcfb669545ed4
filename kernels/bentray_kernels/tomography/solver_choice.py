"""Which solver a reconstruction runs: decided here for those that run it, plan it and report it."""

from typing import NamedTuple

from ..eikonal import METHODS
from ..wave.emissions import Engine
from .settings import DEVIATION, Settings


class Solver(NamedTuple):
    """The method that tracks the wave front of an emitter and its rays.

    Attributes:
        compiled: whether one compiled call does front, rays and back-projection; see ``sart.emitter_pass``.
        eikonal: the method of the wave front, ``deviation`` or one of ``eikonal.methods()``; None for
            straight rays, which need no travel time.
    """

    compiled: bool
    eikonal: str | None


def solver_of(settings: Settings, dimensions: int) -> Solver:
    """The solver of one method.

    Args:
        settings: whose ``method`` is that of an image, never ``auto`` or ``waveform``.
        dimensions: of an image, 2 or 3.
    """
    straight = settings.rays == "straight"
    differences = settings.numerics.ray_gradient == "differences"
    supported = straight or (settings.eikonal == DEVIATION and differences)
    if settings.method == "sart" and dimensions == 2 and supported:
        return Solver(True, None if straight else DEVIATION)
    return Solver(False, None if straight else settings.ray_eikonal)


def sart_engine(settings: Settings, dimensions: int) -> Engine:
    """The engine of SART on slices: a device has the compiled pass, with a wave front in the image itself."""
    changed = settings.numerics.speed_range_mps is not None
    able = solver_of(settings, dimensions).compiled and not (changed and settings.rays == "curved")
    return "opencl" if settings.device == "opencl" and able else "compiled"


def undivided_reason(settings: Settings, *, amplitudes: bool) -> str:
    """Why a volume is not reconstructed in blocks of planes, in words; empty where it can be.

    Args:
        settings: of the volume.
        amplitudes: whether the scan has them.
    """
    numerics = settings.numerics
    reasons = {
        f"decomposition {settings.decomposition}": settings.decomposition != "volume",
        f"method {settings.method}": settings.method != "sart",
        f"eikonal {settings.eikonal}": settings.rays == "curved"
        and settings.eikonal not in (DEVIATION, "fsm"),
        "speed_range_mps": numerics.speed_range_mps is not None,
        "coarser grids": numerics.coarser_grids > 0,
        "other gradients": numerics.ray_gradient != "differences",
        "resolution_check": settings.resolution_check,
        "uncertainty": settings.estimates_uncertainty,
        "attenuation": settings.attenuation.enabled and amplitudes,
    }
    return next((reason for reason, holds in reasons.items() if holds), "")


def wave_engine(settings: Settings) -> Engine:
    """The engine of full waveforms, for a refinement and for the validation of an image by ``auto``."""
    return "opencl" if settings.device == "opencl" and settings.selects_model else "compiled"


def echo_engine(settings: Settings) -> Engine:
    """The engine that sums the echoes of a reflection image."""
    return "opencl" if settings.device == "opencl" and settings.reflection.enabled else "compiled"


def needs_device(settings: Settings) -> bool:
    """Whether a call of the reconstruction computes on an OpenCL device."""
    dimensions = 3 if settings.decomposition == "volume" else 2
    engines = wave_engine(settings), echo_engine(settings), sart_engine(settings, dimensions)
    return tracks_on_device(settings) or "opencl" in engines


def tracks_on_device(settings: Settings) -> bool:
    """Whether wave fronts are tracked on an OpenCL device."""
    # Candidate models have curved rays whatever the setting.
    straight = settings.rays == "straight" and not settings.selects_model
    return not straight and METHODS[settings.ray_eikonal].on_device
