"""Numerical parameters of a reconstruction: decided automatically, fixed by benchmarks and tests."""

import json
from dataclasses import asdict, dataclass
from typing import Literal

from ..requests.limits import check_speeds
from ..requests.names import RayGradient
from ..requests.ranges import SEED, Range, ranged
from ..requests.request_fields import check

BANDS = 4


@dataclass(frozen=True)
class Numerics:
    """Parameters that no user sets. The defaults are the automatic decision, None one that needs the scan.

    Attributes:
        relaxation: factor λ of an update of SART (Li 2008, chapter 6, equation 1).
        speed_range_mps: of SART, lowest and highest speed known in the object, m/s, to which the image is
            stretched before the wave front is tracked (data-driven speed, Li 2008, chapter 6, equation 6);
            None: the image as it is.
        pixel_m: spacing of the pixels of a reflection image, m; None: an eighth of the wavelength in water at
            the centre frequency, at most 2048 pixels along a side.
        coarser_grids: grids, each of half the nodes of the next, that come first.
        stop_rms_s: stop once the rms residual is at most this, s (Morozov's discrepancy principle); None:
            ``method`` auto takes it from the noise of the times, other methods do not stop early.
        ray_width_m: of Gauss–Newton, standard deviation of the Gaussian across a ray under which its time
            depends on the slowness, m; 0: thin rays. ``method`` auto sets it from the centre frequency.
        ray_gradient: how ∇(T²) guides curved rays, ``differences`` or ``bspline`` (chapter 6.3), see
            ``rays.trace``. The compiled pass over slices has differences alone, so ``bspline`` replaces it.
        subset: emitters in one update of SART.
        huber_scale: Gauss–Newton and the attenuation weigh residuals beyond this many standard deviations
            linearly (Huber); 0: none.
        reciprocity: use the time of the reverse pair where a pair is missing.
        bands: of full-waveform refinement, bands of frequency from the lowest; None: as many of the four as
            the time budget allows.
        emitters: of full-waveform refinement, drawn in each band; None: 32 or 40, fewer where the time budget
            does not allow one band.
        seed: of the random order of emitters, and of the probes of the uncertainty.
        smoothing_nodes: of SART, standard deviation of the Gaussian filter on each update, nodes; 0: none.
        penalty: of Gauss–Newton; total-variation preserves edges, laplacian prefers smooth images, tikhonov
            images near the initial one.
        edge_mps: of total variation, difference of neighbouring nodes, m/s, above which the penalty stays
            constant; 0: it grows with every difference. ``method`` auto tries sharp edges.
        attenuation_solver: penalised: all rays at once; sart: one emitter after the other, without a penalty
            (Li 2008, chapter 6).
        focusing: correct amplitudes for focusing by refraction, by the spreading of ray tubes; it needs the
            frequency of the amplitudes.
        delays: of echoes, travel times in the reconstructed speed or, for comparison, in water.

    Raises:
        InvalidInput: naming the parameter.
    """

    relaxation: float = ranged(0.1, Range(0.0, 2.0, above=True, below=True))
    speed_range_mps: tuple[float, float] | None = None
    pixel_m: float | None = ranged(None, Range(1e-6, 1.0, unit="m"))
    coarser_grids: int = ranged(0, Range(0, 6))
    stop_rms_s: float | None = ranged(None, Range(0.0, 1.0, unit="s"))
    ray_width_m: float = ranged(0.0, Range(0.0, 0.1, unit="m"))
    ray_gradient: RayGradient = "differences"
    subset: int = ranged(1, Range(1, 4096))
    huber_scale: float = ranged(3.0, Range(0.0, 100.0))
    reciprocity: bool = True
    bands: int | None = ranged(None, Range(1, BANDS))
    blocks: int = ranged(1, Range(1, 2048))
    emitters: int | None = ranged(None, Range(1, 4096))
    seed: int = ranged(0, SEED)
    smoothing_nodes: float = ranged(1.0, Range(0.0, 32.0))
    penalty: Literal["total-variation", "laplacian", "tikhonov"] = "total-variation"
    edge_mps: float = ranged(0.0, Range(0.0, 1000.0, unit="m/s"))
    attenuation_solver: Literal["penalised", "sart"] = "penalised"
    focusing: bool = False
    delays: Literal["reconstructed", "water"] = "reconstructed"

    def __post_init__(self) -> None:
        check(self)
        if self.speed_range_mps is not None:
            check_speeds("speed_range_mps", self.speed_range_mps)

    def residual_within_noise(self, rms_s: float) -> bool:
        """Whether a residual, s, is small enough to stop."""
        return rms_s <= (self.stop_rms_s or 0.0)


def recorded(numerics: Numerics) -> dict[str, str]:
    """The parameters as an entry of a result's provenance."""
    return {"numerics": json.dumps(asdict(numerics))}
