"""Errors of the model in an image made from travel times: how large they are, and when a reader must know."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from ...arrays import Flags, Floats

# First arrivals follow a thin fast layer, such as the skin: the image shows it too fast and too thick, and
# what lies behind it too slow. And where the misfit is above the noise, the rays of a region share what the
# model lacks, and its errors do not average out as noise does. ``CONTRAST`` is the part of the square of the
# contrast to the surroundings that may be wrong in layers that guide rays, or of a misfit that is not noise;
# of such a misfit the variance of the posterior grows by ``POSTERIOR``. Chosen with 24 simulated scans for
# the highest likelihood of their errors; ``bentray bench uncertainty`` judges them on others.
CONTRAST, POSTERIOR = 0.4, 1.5

# Surroundings of a node: a Gaussian of this part of the side of the image, over twice the size of a lobe of
# tissue. Rays are counted within ``RAYS_NODES``.
SURROUNDINGS, RAYS_NODES = 0.063, 0.75

# Above these an image is called into question: misfit over noise; misfit in crossing times of a node, below
# which there are errors of the grid; contrast where rays gather over all contrast. Chosen with these scans.
MISFIT_OVER_NOISE, MISFIT_CROSSING, GUIDED = 1.9, 0.05, 0.5


@dataclass(frozen=True)
class ModelErrors:
    """What an image and its misfit say about errors of the model.

    Attributes:
        contrast: as the image, m/s: difference of each node to its surroundings.
        guided: root mean square of contrast times relative excess of rays, over that of contrast: about 0
            without layers that guide rays.
        unexplained: from 0 to 1, square of the part of the misfit's variance that is not noise.
        noise_s: standard deviation of the times, s; 0 if it is not known.
        misfit_s: root mean square of the misfit, s, at least ``noise_s``.
        crossing_s: of a node at the speed of water, s.
    """

    contrast: Floats
    guided: float
    unexplained: float
    noise_s: float
    misfit_s: float
    crossing_s: float

    @classmethod
    def of(
        cls,
        speed: Floats,
        region: Flags,
        density: Floats,
        noise_s: float,
        misfit_s: float,
        crossing_s: float,
    ) -> ModelErrors:
        """Errors of an image.

        Args:
            speed: (nx, ny[, nz]), m/s.
            region: nodes that may change, at least one.
            density: nodes of ray through each node.
            noise_s, misfit_s, crossing_s: see the attributes.
        """
        contrast = speed - _around(speed, SURROUNDINGS * (max(speed.shape) - 1))
        square = float((contrast[region] ** 2).mean())
        gathered = float(((contrast * _excess(density, region))[region] ** 2).mean())
        return cls(
            contrast,
            float(np.sqrt(gathered / square)) if square > 0.0 else 0.0,
            (1.0 - (noise_s / misfit_s) ** 2) ** 2,
            noise_s,
            misfit_s,
            crossing_s,
        )

    def added_to(self, squares: Floats) -> Floats:
        """Expected squares of the errors, (m/s)², from those of the posterior."""
        wrong = CONTRAST * (self.guided + self.unexplained) * self.contrast**2
        return np.asarray((1.0 + POSTERIOR * self.unexplained) * squares + wrong)

    @property
    def caution(self) -> str:
        """A sentence for the reader of the image if its deviations may be too small; else empty."""
        reasons = []
        over = self.misfit_s / self.noise_s if self.noise_s > 0.0 else 0.0
        if over >= MISFIT_OVER_NOISE and self.misfit_s >= MISFIT_CROSSING * self.crossing_s:
            reasons.append(
                f"bent rays through the image leave a misfit of {1e9 * self.misfit_s:.0f} ns, {over:.1f} "
                "times the noise of the times, so that errors of the model exceed those of the data"
            )
        if self.guided >= GUIDED:
            reasons.append(
                "first arrivals follow a thin fast layer, which the image shows too fast and too thick, and "
                "what lies behind it too slow"
            )
        if not reasons:
            return ""
        return f"The standard deviations may be too small: {'; and '.join(reasons)}."


def _excess(density: Floats, region: Flags) -> Floats:
    """Relative excess of rays over the surroundings, at least 0."""
    radius = SURROUNDINGS * (max(density.shape) - 1)
    rays = np.where(region, density, 0.0)
    around = _around(rays, radius) / np.maximum(_around(region.astype(float), radius), 1e-9)
    return np.maximum(_around(rays, RAYS_NODES) / np.maximum(around, 1e-9) - 1.0, 0.0)


def _around(image: Floats, radius: float) -> Floats:
    return np.asarray(gaussian_filter(image, radius, mode="nearest"))
