"""Result of a reconstruction: images, history, settings and provenance."""

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .settings import Settings

# Edges of the bins of residuals, s: eight a decade from 0.1 ns to 0.1 ms, both signs, and one around zero.
_DECADES = np.logspace(-10.0, -4.0, 49)
RESIDUAL_EDGES_S = np.concatenate((-_DECADES[::-1], _DECADES))


# Begins the first line of a doubtful result, and the advice of its job.
DOUBTFUL = "Doubtful result."
CHECK = "Else check the scan (bentray quality): units, order of the elements, time zero, speed of the water."

# Entry of the provenance where full waveforms are advised: how many times the noise the held-out misfit is.
EXCESS = "misfit_over_noise"

# Subjects of cautions by their codes.
SUBJECTS = {
    "bounds": "cut off by the speed bounds",
    "residual": "does not explain the times",
    "constant": "no better than one constant speed",
    "noise": "times contradict each other",
    "uncertainty": "deviations may be too small",
    "attenuation": "attenuation not better than a constant",
    "settings": "settings without effect",
}

# Width at half height of a Gaussian, in standard deviations.
HALF_HEIGHT = 2.0 * math.sqrt(2.0 * math.log(2.0))


def residual_counts(residuals: NDArray[np.float64]) -> NDArray[np.int64]:
    """Histogram of residuals, s, over ``RESIDUAL_EDGES_S``; the outer bins include all beyond the ends."""
    within = np.clip(residuals, RESIDUAL_EDGES_S[0], RESIDUAL_EDGES_S[-1])
    return np.histogram(within, RESIDUAL_EDGES_S)[0].astype(np.int64)


def residual_within(counts: NDArray[np.int64], share: float) -> float:
    """The absolute residual, s, that this share does not exceed; 0 without residuals.

    Args:
        counts: of the bins between ``RESIDUAL_EDGES_S``.
        share: in (0, 1]; residuals are assumed uniform in a bin.
    """
    if not counts.sum():
        return 0.0
    middle = len(counts) // 2
    # Both signs together, from the bin around zero outwards.
    sizes = np.concatenate((counts[middle : middle + 1], counts[middle + 1 :] + counts[middle - 1 :: -1]))
    edges = np.concatenate(([0.0], RESIDUAL_EDGES_S[middle + 1 :]))
    below = np.concatenate(([0.0], np.cumsum(sizes) / counts.sum()))
    k = int(np.searchsorted(below, share - 1e-12)) - 1
    fraction = (share - below[k]) / (below[k + 1] - below[k])
    return float(edges[k] + fraction * (edges[k + 1] - edges[k]))


@dataclass(frozen=True)
class Caution:
    """Something that the reader of a result must know.

    Attributes:
        code: ``bounds``: the image is cut off by the speed bounds; ``residual``: it does not explain the
            times; ``constant``: it explains them no better than one speed; ``noise``: they contradict each
            other; ``uncertainty``: the standard deviations may be too small; ``attenuation``: its image
            predicts held-out amplitudes no better than a constant; ``settings``: settings without effect.
        text: one or two sentences for the reader, with the numbers and what to do.
        doubtful: whether the image itself is in doubt.
    """

    code: str
    text: str
    doubtful: bool = False


@dataclass(frozen=True)
class Iteration:
    """One iteration over all emitters of one slice, or of the volume.

    Attributes:
        slice: axial index, from 0; 0 for a volume.
        sweep: number of the iteration, from 1; the name is that of the stored files.
        residual_rms_s: root mean square of measured minus predicted travel time, s, before the update of each
            emitter (SART) or of all emitters (Gauss–Newton).
        emitters: number of emitters with data.
        stage: from 0; coarser grids and straight rays before the requested ones are stages of their own.
        given: whether the misfit belongs to the image that the stage returned: every iteration of SART, whose
            last one is nearest to it; the best image of Gauss–Newton, once it is known.
        band_hz: of full-waveform refinement, (lower, upper) corner of the band. The residual is then the time
            shift of a wave in the middle of the band with the same misfit.
        misfit: of the waveforms, 0 where they agree and 1 where they are uncorrelated.
        held_out_misfit: the same of held-out emitters.
        of_attenuation: whether the attenuation was refined; the residual is then that of the fixed speed.
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
    """Progress of a reconstruction: ``done`` of ``total`` emitter passes, over all slices and iterations.

    Attributes:
        phase: name of the current phase, if there are several; each has its own count.
    """

    done: int
    total: int
    history: tuple[Iteration, ...] = ()
    phase: str = ""


@dataclass(frozen=True)
class Candidate:
    """A candidate model, reconstructed from the training pairs.

    Attributes:
        settings: changes relative to the requested settings, by name.
        held_out_rms_s: rms misfit of the held-out pairs, s.
        shown_rms_s: rms misfit of the training pairs, s, in the last iteration.
        held_out_mean_s: mean absolute misfit of the held-out pairs, s, less sensitive to wrong picks; None in
            files of earlier versions.
    """

    settings: dict[str, Any]
    held_out_rms_s: float
    shown_rms_s: float
    held_out_mean_s: float | None = None


class GridImage(NamedTuple):
    """Values of a quantity, (nx, ny[, nz]), with spacing and position of node 0 per axis, m."""

    values: NDArray[np.float64]
    spacing_m: tuple[float, ...]
    origin_m: tuple[float, ...]


@dataclass(frozen=True)
class Reflection:
    """A reflection image, with a grid of its own.

    Attributes:
        db: (nx, ny[, nz]), envelope of the echoes relative to its maximum, dB, at most 0; the lowest value
            outside the array.
        spacing_m, origin_m: of its pixels (x, y[, z]), m; z as in the reconstruction.
    """

    db: NDArray[np.float64]
    spacing_m: tuple[float, ...]
    origin_m: tuple[float, ...]


@dataclass(frozen=True)
class Reconstruction:
    """A reconstructed scan.

    Attributes:
        speed: (nx, ny), or (nx, ny, nz) for several slices or a volume, m/s.
        coverage: as ``speed``: metres of ray through each node in the last iteration that changed the image.
        attenuation: as ``speed``, Np/m, or None.
        recovery: as ``speed``: recovered fraction of a checkerboard's contrast, or None.
        uncertainty: as ``speed``, standard deviation, m/s, of the speed from the truth smoothed by the
            resolution width; 0 at nodes that are kept as water. None if not requested.
        resolution_width_m: standard deviation, m, of the Gaussian that smooths the truth like the image: one
            for each slice, or one for a slice or volume; empty without uncertainty.
        reflection: image of echoes on a grid of its own, or None.
        spacing_m: node spacing (x, y[, z]), m; z is NaN when the slices are not evenly spaced.
        origin_m: position of node 0 (x, y[, z]), m.
        water_speed_mps: speed of the coupling water, m/s.
        history: a record per slice, stage and iteration, in order of stage, iteration, slice.
        residuals: histogram of the residuals of the last iteration over ``RESIDUAL_EDGES_S``.
        settings: the settings that were used; never ``method`` auto.
        trials: the candidate models of ``auto``, the best first.
        cautions: what the reader must know, doubts about the image first.
        provenance: versions of the software, and automatic decisions.
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
    uncertainty: NDArray[np.float64] | None = None
    resolution_width_m: tuple[float, ...] = ()
    reflection: Reflection | None = None
    residuals: NDArray[np.int64] | None = None
    trials: tuple[Candidate, ...] = ()
    cautions: tuple[Caution, ...] = ()
    provenance: dict[str, str] = field(default_factory=dict)

    def image(self, quantity: str) -> GridImage | None:
        """A quantity on its grid; None if the result does not have it.

        Args:
            quantity: ``speed``, ``coverage``, ``attenuation``, ``recovery``, ``uncertainty`` or
                ``reflection``.
        """
        held = getattr(self, quantity)
        if held is None:
            return None
        if isinstance(held, Reflection):
            return GridImage(held.db, held.spacing_m, held.origin_m)
        return GridImage(held, self.spacing_m, self.origin_m)

    def caution(self, code: str) -> str:
        """The text of the caution with a code; empty without it."""
        return next((caution.text for caution in self.cautions if caution.code == code), "")

    @property
    def doubt(self) -> str:
        """Why the image is doubtful, in sentences; empty without a reason."""
        reasons = " ".join(caution.text for caution in self.cautions if caution.doubtful)
        return f"{DOUBTFUL} {reasons} {CHECK}" if reasons else ""

    @property
    def uncertainty_rms_mps(self) -> float | None:
        """Root mean square of the standard deviations of nodes that may change, m/s; None without them."""
        if self.uncertainty is None:
            return None
        # Exactly 0 at nodes that are kept as water.
        inside = self.uncertainty[self.uncertainty != 0.0]
        return float(np.sqrt((inside**2).mean())) if inside.size else 0.0

    @property
    def trust(self) -> str:
        """How far to trust the image, in one line: standard deviation, detail, and cautions by their subject.

        The detail is the width at half height of the Gaussian that smooths the truth like the image, of the
        middle slice, at least the spacing of the nodes.
        """
        deviation = self.uncertainty_rms_mps
        words = ["no standard deviations" if deviation is None else f"±{deviation:.2g} m/s (1 sd)"]
        if self.resolution_width_m:
            detail = HALF_HEIGHT * float(np.median(self.resolution_width_m))
            words.append(f"detail down to {1e3 * max(detail, self.spacing_m[0]):.1f} mm")
        subjects = ", ".join(SUBJECTS.get(caution.code, caution.code) for caution in self.cautions)
        count = len(self.cautions)
        words.append(f"{count} caution{'s' * (count > 1)}: {subjects}" if count else "no cautions")
        return ", ".join(words)

    @property
    def residual_rms_s(self) -> float | None:
        """Root mean square of the misfit over all slices, s; None without a history.

        For each slice the last misfit of the returned image (``given``) in its last stage.
        """
        of_slice: dict[int, tuple[int, float]] = {}
        for record in self.history:
            if record.given and record.stage >= of_slice.get(record.slice, (0, 0.0))[0]:
                of_slice[record.slice] = record.stage, record.residual_rms_s
        if not of_slice:
            return None
        return math.sqrt(sum(rms**2 for _, rms in of_slice.values()) / len(of_slice))
