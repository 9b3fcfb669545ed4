"""Phase two: the attenuation, along the rays of the finished speed image (chapter 6.3, chapter 7).

Experimental: see ``EXPERIMENTAL``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Flags, Floats, Ints
from ..errors import InvalidInput
from . import attenuation_sart
from .focusing import focusing
from .gauss_newton import huber
from .gauss_newton.linear_problem import Linearised, smoothing
from .gauss_newton.linearisation import Rows, linearise_losses, ray_density
from .problem import Problem
from .settings import GaussNewtonSettings, Settings

# In the provenance of every result with an attenuation, until one method beats both on all scans of row R8
# of the benchmarks.
EXPERIMENTAL = "experimental: no method was better than both a constant image and straight rays on all scans"

# Number of solutions. Outlier limit and total variation of each follow from the misfit of the one before;
# total variation needs more, because none of its solutions is iterated to convergence.
PASSES, ROBUST_PASSES = 3, 12

# Log ratios of traces contain diffraction and later paths, more than absorption, and far more where these
# cancel the pulse. Rays do not model details below a Fresnel zone, √(wavelength · longest ray): the image is
# smoothed over ``ZONES`` of them, and the outlier limit is divided by ``TRACES_STRICTER``. Chosen on wave
# simulations, where total variation did worse (``benchmarks/results/raw_trace_experiments.md``).
ZONES, TRACES_STRICTER = 3.0, 2.0

# For validation one in so many of these solutions is made. On the scans that ``cautions.CLEARLY`` was chosen
# on, all of them gave the same verdicts. SART makes all iterations: after few, good images look bad.
VALIDATED = 4

# More than any tissue has at the frequencies that pass through it, Np/m.
MAX_NP_M = 500.0


@dataclass(frozen=True)
class Losses:
    """An attenuation image, and how well amplitudes of held-out views are predicted without them.

    Attributes:
        image: of the region's shape, Np/m.
        held_out: number of pairs held out, and the sums of their squared misfits, Np², by an image of the
            training pairs and by the one attenuation inside the array that fits these best; zeros without
            such pairs.
        guided: how far rays gather in thin fast layers, see ``ModelErrors``.
    """

    image: Floats
    held_out: Floats
    guided: float = 0.0


def active_emitters(problem: Problem) -> Ints:
    """Emitters with amplitudes."""
    if problem.log_ratio is None:
        return np.empty(0, np.int64)
    return np.flatnonzero(np.isfinite(problem.log_ratio).any(axis=1))


def trace_rays(problem: Problem, settings: Settings, slowness: Floats, emitters: Ints) -> Rows:
    """Rows of some emitters along the rays of the finished image; any split gives the same.

    With ``settings.numerics.focusing`` the amplitudes are corrected for focusing by refraction, and pairs
    whose ray has passed a caustic are left out.

    Raises:
        InvalidInput: for ``focusing`` without a frequency.
    """
    if settings.numerics.focusing:
        problem = _without_focusing(problem, settings, slowness, emitters)
    return linearise_losses(problem, settings, slowness, emitters)


def _without_focusing(problem: Problem, settings: Settings, slowness: Floats, emitters: Ints) -> Problem:
    """The problem with the log ratios of some emitters as absorption alone would have them."""
    if problem.log_ratio is None:
        return problem
    wavelength = _wavelength(problem, "focusing")
    ratio = problem.log_ratio.copy()
    for ring in np.unique(problem.ring[emitters]):
        members = emitters[problem.ring[emitters] == ring]
        ratio[members] -= focusing(
            slowness,
            problem.spacing,
            problem.emitters[members],
            problem.receivers[ring],
            wavelength_m=wavelength,
            longest_m=problem.longest_m,
            eikonal=settings.ray_eikonal,
        )
    return replace(problem, log_ratio=ratio)


def validate(
    problem: Problem, settings: Settings, blocks: Sequence[Rows], training: Flags, held_out: Flags
) -> Floats:
    """``Losses.held_out`` of the rows of all emitters.

    Scattered pairs would not do: their neighbours have the same focusing, which an image fits.

    Args:
        training, held_out: (rays,), in the order of the rows.
    """
    ends = np.cumsum([block.residual.size for block in blocks])[:-1]
    shown, held = (
        [block.chosen(rays) for block, rays in zip(blocks, np.split(part, ends), strict=True)]
        for part in (training, held_out)
    )
    water = problem.water_attenuation
    image = (solve(problem, settings, shown, VALIDATED) - water) * problem.spacing
    inside = np.where(problem.region, problem.spacing, 0.0)
    lengths, data = _projected(shown, inside), np.concatenate([part.residual for part in shown])
    constant = max(float(lengths @ data) / max(float(lengths @ lengths), 1e-300), -water)
    measured = np.concatenate([part.residual for part in held])
    misfits = (measured - _projected(held, values) for values in (image, constant * inside))
    return np.array([measured.size, *(float(misfit @ misfit) for misfit in misfits)])


def _projected(rows: Sequence[Rows], image: Floats) -> Floats:
    return np.concatenate([part.project(image) for part in rows])


def solve(problem: Problem, settings: Settings, blocks: Sequence[Rows], one_in: int = 1) -> Floats:
    """The attenuation from the rows of all emitters, in their order.

    The rays are fixed, so the problem is linear: log ratios are integrals of the attenuation, once focusing
    is taken off. It is solved for all rays at once with a penalty, or by SART, see ``attenuation_sart``.

    Args:
        problem, settings: of the rows.
        blocks: rows.
        one_in: one in so many of the passes over all rays is made; SART makes all of its iterations.

    Returns:
        of the region's shape, Np/m, at least 0; that of the water outside the array.

    Raises:
        InvalidInput: for amplitudes from traces without a frequency.
    """
    shape = problem.region.shape
    water = np.full(shape, problem.water_attenuation * problem.spacing)
    density = problem.mean_in_region(ray_density(problem, blocks))
    if density == 0.0:
        return water / problem.spacing
    bounds = (0.0, MAX_NP_M * problem.spacing)
    if settings.numerics.attenuation_solver == "sart":
        return attenuation_sart.solve(blocks, water, problem.region, settings, bounds) / problem.spacing
    image, dual = water, np.zeros((len(shape), *shape))
    # Rays through a blurred speed image are all somewhat off, and none is an outlier: on Table 6 after SART
    # the limit made the error larger, after Gauss–Newton a third smaller.
    spreads = settings.numerics.huber_scale if settings.method == "gauss-newton" else 0.0
    smooth = None
    if settings.reads_amplitudes:
        spreads, smooth = settings.numerics.huber_scale / TRACES_STRICTER, _smoothing(problem, settings)
    passes = ROBUST_PASSES if spreads and smooth is None else PASSES
    for _ in range(max(1, passes // one_in)):
        remaining = [replace(part, residual=part.residual - part.project(image - water)) for part in blocks]
        residual = np.concatenate([block.residual for block in remaining])
        limit = huber.limit(residual, spreads)
        misfit = huber.clipped_rms(residual, limit)
        image, dual = Linearised(
            remaining,
            image,
            density,
            problem.region,
            bounds,
            settings.gauss_newton.penalty_strength * misfit if smooth is None else smooth,
            "total-variation" if smooth is None else "laplacian",
            huber=limit,
        ).solve(dual)
    return image / problem.spacing


def _smoothing(problem: Problem, settings: Settings) -> float:
    """Strength of the penalty for log ratios from traces."""
    finest_m = ZONES * math.sqrt(
        _wavelength(problem, f"amplitudes {settings.attenuation.amplitudes}") * problem.longest_m
    )
    usual = settings.gauss_newton.penalty_strength / GaussNewtonSettings.penalty_strength
    return usual * smoothing(2.0 * math.pi * problem.spacing / finest_m)


def _wavelength(problem: Problem, setting: str) -> float:
    """Wavelength of the amplitudes in water, m.

    Raises:
        InvalidInput: where it is unknown, naming the setting that needs it.
    """
    if problem.wavelength_m is None:
        raise InvalidInput(
            "amplitude@frequency_hz", "nothing", f"a frequency in Hz, for the setting {setting}"
        )
    return problem.wavelength_m
