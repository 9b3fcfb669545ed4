"""Numerical parameters of a reconstruction: decided automatically, fixed by benchmarks and tests."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from ..ranges import Range, ranged
from ..ray_gradient_names import RayGradient
from ..request_fields import check

BANDS = 4


@dataclass(frozen=True)
class Numerics:
    """Parameters that no user sets. The defaults are the automatic decision, None one that needs the scan.

    Attributes:
        axial_margin_nodes: in a volume, how far above and below an emitter and its receivers the wave front
            is tracked, nodes; None: everywhere. Fast skin can guide first arrivals far out of its plane.
        straight_iterations: iterations with straight rays before those with bent rays.
        coarser_grids: grids, each of half the nodes of the next, that come first.
        stop_rms_s: stop once the rms residual is at most this, s (Morozov's discrepancy principle); None:
            ``method`` auto takes it from the noise of the times, other methods do not stop early.
        front_smoothing_nodes: standard deviation, nodes, of a Gaussian on the speed that the wave front runs
            in: rays bend as those of a band-limited wave; 0: none.
        ray_width_m: of Gauss–Newton, standard deviation of the Gaussian across a ray under which its time
            depends on the slowness, m; 0: thin rays. ``method`` auto sets it from the centre frequency.
        ray_gradient: how ∇(T²) guides curved rays, ``differences`` or ``bspline`` (chapter 6.3), see
            ``rays.trace``. The compiled pass over slices has differences alone, so ``bspline`` replaces it.
        relaxation_decay: factor of SART's relaxation from one iteration to the next, in (0, 1].
        subset: emitters in one update of SART.
        huber_scale: Gauss–Newton and the attenuation weigh residuals beyond this many standard deviations
            linearly (Huber); 0: none.
        reciprocity: use the time of the reverse pair where a pair is missing.
        guided_rounds: how often arrivals are picked again near the times that the image predicts; slices.
        bands: of full-waveform refinement, bands of frequency from the lowest; None: as many of the four as
            the time budget allows.
        emitters: of full-waveform refinement, drawn in each band; None: 32 or 40, fewer where the time budget
            does not allow one band.

    Raises:
        InvalidInput: naming the parameter.
    """

    axial_margin_nodes: int | None = ranged(None, Range(2, 4096))
    straight_iterations: int = ranged(0, Range(0, 1000))
    coarser_grids: int = ranged(0, Range(0, 6))
    stop_rms_s: float | None = ranged(None, Range(0.0, 1.0, unit="s"))
    front_smoothing_nodes: float = ranged(0.0, Range(0.0, 32.0))
    ray_width_m: float = ranged(0.0, Range(0.0, 0.1, unit="m"))
    ray_gradient: RayGradient = "differences"
    relaxation_decay: float = ranged(1.0, Range(0.0, 1.0, above=True))
    subset: int = ranged(1, Range(1, 4096))
    huber_scale: float = ranged(3.0, Range(0.0, 100.0))
    reciprocity: bool = True
    guided_rounds: int = ranged(0, Range(0, 10))
    bands: int | None = ranged(None, Range(1, BANDS))
    blocks: int = ranged(1, Range(1, 2048))
    emitters: int | None = ranged(None, Range(1, 4096))

    def __post_init__(self) -> None:
        check(self)

    def residual_within_noise(self, rms_s: float) -> bool:
        """Whether a residual, s, is small enough to stop."""
        return rms_s <= (self.stop_rms_s or 0.0)


def recorded(numerics: Numerics) -> dict[str, str]:
    """The parameters as an entry of a result's provenance."""
    return {"numerics": json.dumps(asdict(numerics))}
