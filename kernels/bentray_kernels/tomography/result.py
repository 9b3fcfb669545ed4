"""What a reconstruction gives: the images, how it got there, and what is needed to repeat it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .settings import Settings


@dataclass(frozen=True)
class Sweep:
    """One pass over all emitters of one slice.

    Attributes:
        slice: axial index, from 0.
        sweep: number of the pass, from 1.
        residual_rms_s: root mean square of measured minus predicted travel time, s, before the update: of
            each emitter as the pass met it (SART), of all at once (Gauss–Newton).
        emitters: how many emitters had data.
    """

    slice: int
    sweep: int
    residual_rms_s: float
    emitters: int


@dataclass(frozen=True)
class Progress:
    """How far a reconstruction is: ``done`` of ``total`` emitter passes, over all slices and sweeps."""

    done: int
    total: int
    history: tuple[Sweep, ...] = ()


@dataclass(frozen=True)
class Reconstruction:
    """A reconstructed scan.

    Attributes:
        speed: (nx, ny), or (nx, ny, nz) for several slices, m/s.
        coverage: as ``speed``: metres of ray through each node in the last sweep that changed the image.
        attenuation: as ``speed``, Np/m, or None.
        spacing_m: node spacing (x, y[, z]), m; z is NaN when the slices are not evenly spaced.
        origin_m: position of node 0 (x, y[, z]), m.
        water_speed_mps: speed of the coupling water, m/s.
        history: a record per slice and sweep, in order of sweep then slice.
        settings: the settings that were used.
        provenance: versions of what computed it.
    """

    speed: NDArray[np.float64]
    coverage: NDArray[np.float64]
    spacing_m: tuple[float, ...]
    origin_m: tuple[float, ...]
    water_speed_mps: float
    settings: Settings
    history: tuple[Sweep, ...] = ()
    attenuation: NDArray[np.float64] | None = None
    provenance: dict[str, str] = field(default_factory=dict)

    @property
    def residual_rms_s(self) -> float | None:
        """Root mean square of the misfit over all slices, s; None without a history.

        Of each slice that of its last sweep, or with Gauss–Newton, which gives the best image that it
        measured, its least.
        """
        of_slice: dict[int, float] = {}
        for sweep in self.history:
            known = of_slice.get(sweep.slice, math.inf)
            least = self.settings.method == "gauss-newton" and known < sweep.residual_rms_s
            of_slice[sweep.slice] = known if least else sweep.residual_rms_s
        if not of_slice:
            return None
        return math.sqrt(sum(rms**2 for rms in of_slice.values()) / len(of_slice))
