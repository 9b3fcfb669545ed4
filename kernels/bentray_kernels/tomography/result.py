"""What a reconstruction gives: the images, how it got there, and what is needed to repeat it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .settings import Settings

# Edges of the bins of residuals, s: eight a decade from 0.1 ns to 0.1 ms, both signs, and one around zero.
_DECADES = np.logspace(-10.0, -4.0, 49)
RESIDUAL_EDGES_S = np.concatenate((-_DECADES[::-1], _DECADES))


def residual_counts(residuals: NDArray[np.float64]) -> NDArray[np.int64]:
    """How many residuals, s, fall between two of ``RESIDUAL_EDGES_S``; those beyond the ends count there."""
    within = np.clip(residuals, RESIDUAL_EDGES_S[0], RESIDUAL_EDGES_S[-1])
    return np.histogram(within, RESIDUAL_EDGES_S)[0].astype(np.int64)


@dataclass(frozen=True)
class Iteration:
    """One pass over all emitters of one slice, or of the volume.

    Attributes:
        slice: axial index, from 0; 0 for a volume.
        sweep: number of the pass, from 1.
        residual_rms_s: root mean square of measured minus predicted travel time, s, before the update: of
            each emitter as the pass met it (SART), of all at once (Gauss–Newton).
        emitters: how many emitters had data.
        stage: from 0: coarser grids and straight rays that come first are stages of their own.
        given: whether the misfit is that of the image which the stage gave: with SART, as near as a pass
            comes to it; with Gauss–Newton of the best image, once it is known which.
        band_hz: of an image that was refined by waveforms, (lower, upper) corner of the band. Its residual is
            then the shift of a wave in the middle of the band that has the same misfit.
        misfit: of its waveforms, 0 where they agree and 1 where they are uncorrelated.
        held_out_misfit: the same of held-out emitters.
        of_attenuation: whether waveforms refined that; the residual is then that of the speed, which stays.
    """

    slice: int
    sweep: int
    residual_rms_s: float
    emitters: int
    stage: int = 0
    given: bool = True
    band_hz: tuple[float, float] | None = None
    misfit: float | None = None
    held_out_misfit: float | None = None
    of_attenuation: bool = False


@dataclass(frozen=True)
class Progress:
    """How far a reconstruction is: ``done`` of ``total`` emitter passes, over all slices and sweeps.

    Attributes:
        phase: what the passes are of, where there are several such things; each counts its own.
    """

    done: int
    total: int
    history: tuple[Iteration, ...] = ()
    phase: str = ""


@dataclass(frozen=True)
class Trial:
    """One way to reconstruct, tried on part of the pairs.

    Attributes:
        settings: changes relative to the requested settings, by name.
        held_out_rms_s: rms misfit of the pairs that it was not shown, s.
        shown_rms_s: rms misfit of those that it was shown, s, in its last sweep.
        held_out_mean_s: mean size of the misfit of the former, s, of which wrong picks are a smaller part;
            None in files of before it was kept.
    """

    settings: dict[str, Any]
    held_out_rms_s: float
    shown_rms_s: float
    held_out_mean_s: float | None = None


@dataclass(frozen=True)
class Reconstruction:
    """A reconstructed scan.

    Attributes:
        speed: (nx, ny), or (nx, ny, nz) for several slices or a volume, m/s.
        coverage: as ``speed``: metres of ray through each node in the last sweep that changed the image.
        attenuation: as ``speed``, Np/m, or None.
        recovery: as ``speed``: how much of a checkerboard the rays bring back, 1 where all, or None.
        spacing_m: node spacing (x, y[, z]), m; z is NaN when the slices are not evenly spaced.
        origin_m: position of node 0 (x, y[, z]), m.
        water_speed_mps: speed of the coupling water, m/s.
        history: a record per slice, stage and sweep, in order of stage, sweep, slice.
        residuals: how many residuals of the last sweep fall between two of ``RESIDUAL_EDGES_S``.
        settings: the settings that were used; never ``method`` auto.
        trials: what ``auto`` tried, the best first.
        provenance: versions of what computed it.
    """

    speed: NDArray[np.float64]
    coverage: NDArray[np.float64]
    spacing_m: tuple[float, ...]
    origin_m: tuple[float, ...]
    water_speed_mps: float
    settings: Settings
    history: tuple[Iteration, ...] = ()
    attenuation: NDArray[np.float64] | None = None
    recovery: NDArray[np.float64] | None = None
    residuals: NDArray[np.int64] | None = None
    trials: tuple[Trial, ...] = ()
    provenance: dict[str, str] = field(default_factory=dict)

    @property
    def residual_rms_s(self) -> float | None:
        """Root mean square of the misfit over all slices, s; None without a history.

        Of each slice the last misfit that is one of the image given, in its last stage.
        """
        of_slice: dict[int, tuple[int, float]] = {}
        for sweep in self.history:
            if sweep.given and sweep.stage >= of_slice.get(sweep.slice, (0, 0.0))[0]:
                of_slice[sweep.slice] = sweep.stage, sweep.residual_rms_s
        if not of_slice:
            return None
        return math.sqrt(sum(rms**2 for _, rms in of_slice.values()) / len(of_slice))
