"""Acoustic waves: a finite-difference simulator in plane and space; in a plane its adjoint and refinement."""

from .adjoint import Slope, slope, stored_bytes
from .chain import WaveChain, WaveScan
from .continuation import Refined, refine
from .medium import Medium
from .preparation import prepare
from .problem import WaveProblem
from .room import emission_bytes
from .settings import Band, WaveSettings, bands
from .simulation import simulate
from .standing import BandEnd, Image, WaveStanding

__all__ = [
    "Band",
    "BandEnd",
    "Image",
    "Medium",
    "Refined",
    "Slope",
    "WaveChain",
    "WaveProblem",
    "WaveScan",
    "WaveSettings",
    "WaveStanding",
    "bands",
    "emission_bytes",
    "prepare",
    "refine",
    "simulate",
    "slope",
    "stored_bytes",
]
