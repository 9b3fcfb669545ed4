"""Standard deviation of each node and resolution width of an image made from travel times."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from ...arrays import Floats
from ..finite_frequency import width_in_nodes
from ..gauss_newton import huber
from ..gauss_newton.linearisation import Rows, ray_density
from ..problem import Problem
from ..settings import Settings
from .model_errors import ModelErrors, around
from .posterior import Posterior
from .probe_product import LANES

# Correlation of the prior, as a part of the side of the image: the size of a lobe of tissue in a breast. The
# prior's deviation at a node is ``PRIOR`` times the contrast of the image within that distance, at least
# ``PRIOR_FLOOR`` of the mean contrast and ``PRIOR_FLOOR_MPS``. Half or twice any of these changes the
# deviations by less than a fifth.
CORRELATION, PRIOR, PRIOR_FLOOR, PRIOR_FLOOR_MPS = 0.026, 1.5, 0.15, 2.0

# The spread counts so many times: the prior follows the contrast of the image, which noise has flattened.
SPREAD = 2.0

# Widths that the truth may be smoothed by, nodes. Breasts are nearest to the truth smoothed by 0.75 to 1.25,
# and no detail finer than the latter is promised.
WIDTHS = (1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0, 6.0)


@dataclass(frozen=True)
class Uncertainty:
    """How far an image may be from the truth smoothed to its resolution.

    Attributes:
        deviation: as the image, m/s: root mean square, over the posterior, of image minus smoothed truth;
            0 at nodes that are kept as water.
        width_m: standard deviation, m, of the Gaussian for which the smoothed truth is expected to be
            nearest to the image.
        caution: a sentence if the deviations may be too small; else empty.
    """

    deviation: Floats
    width_m: float
    caution: str = ""


def ray_uncertainty(
    problem: Problem, settings: Settings, slowness: Floats, blocks: Sequence[Rows], index: int = 0
) -> Uncertainty:
    """Uncertainty of an image from the linearised problem at that image.

    The noise of a travel time is the misfit of the image, which includes errors of the model, but not less
    than pairs measured both ways differ. The deviation has three parts: the spread of the posterior, smoothed
    like the truth, from the ``LANES`` probes but the first; what the posterior's mean, the first probe, would
    still change, because an image that was stopped early, penalised, or made along straight rays is not the
    mean; and errors of the model, see ``model_errors``.

    Args:
        problem: with each pair once, see ``Problem.each_pair_once``: the time of a reverse pair that was
            filled in is no measurement.
        settings: of the image.
        slowness: of the region's shape, s/m.
        blocks: rows of all emitters along bent rays, in their order.
        index: of the slice, for the random numbers.
    """
    region, spacing = problem.region, problem.spacing
    speed = 1.0 / slowness
    if not region.any() or not blocks:
        return Uncertainty(np.zeros(region.shape), 0.0)
    residual = np.concatenate([block.residual for block in blocks])
    limit = huber.limit(residual, settings.numerics.huber_scale)
    # Exact times of an image without error have no noise: a hundredth of a nanosecond is none.
    noise = max(huber.clipped_rms(residual, limit), problem.noise_s, 1e-11)
    weights = [huber.weights(block.residual, limit) / noise**2 for block in blocks]
    density = ray_density(problem, blocks)
    posterior = Posterior(
        blocks,
        weights,
        np.where(region, _prior(problem, slowness), 0.0),
        CORRELATION * (max(region.shape) - 1),
        max(problem.mean_in_region(density), 1e-300),
        width_in_nodes(problem, settings),
    )
    random = np.random.default_rng((settings.numerics.seed, index))
    prior = random.standard_normal((LANES, *region.shape))
    errors = [random.standard_normal((LANES, weight.size)).T / np.sqrt(weight)[:, None] for weight in weights]
    prior[0] = 0.0
    for error, block in zip(errors, blocks, strict=True):
        error[:, 0] = block.residual
    # From s of crossing time to m/s, linearised as the problem is.
    mean, *samples = -posterior.solutions(errors, prior) * speed**2 / spacing
    squares, width = min(
        (_squares(speed, mean, samples, width) for width in WIDTHS),
        key=lambda pair: float(pair[0][region].sum()),
    )
    errors_of_model = ModelErrors.from_misfit(
        speed, region, density, problem.noise_s, noise, spacing, problem.water_speed
    )
    deviation = np.where(region, np.sqrt(errors_of_model.added_to(squares)), 0.0)
    return Uncertainty(deviation, width * spacing, errors_of_model.caution)


def _prior(problem: Problem, slowness: Floats) -> Floats:
    """Standard deviation of the prior at each node, s of crossing time."""
    contrast = (slowness - 1.0 / problem.water_speed) * problem.spacing
    reach = CORRELATION * (max(contrast.shape) - 1)
    nearby = gaussian_filter(contrast**2, reach, mode="constant")
    mean = problem.mean_in_region(contrast**2)
    least = PRIOR_FLOOR_MPS / problem.water_speed**2 * problem.spacing
    return np.asarray(PRIOR * np.sqrt(nearby + max(PRIOR_FLOOR**2 * mean, least**2)))


def _squares(speed: Floats, mean: Floats, samples: Sequence[Floats], width: float) -> tuple[Floats, float]:
    """Expected squares of image minus truth smoothed by a width, (m/s)², and the width."""
    squares = np.zeros_like(speed)
    for sample in samples:
        squares += around(sample, width) ** 2
    return SPREAD / len(samples) * squares + (speed - around(speed + mean, width)) ** 2, width
