"""Errors of the model in an image made from travel times: how large they are, and when a reader must know."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from ...arrays import Flags, Floats

# Rays gather in thin fast layers such as the skin: variances grow by (1 + excess of rays)**``GATHERED``,
# with ``CONTRAST`` of the squared contrast and ``BEHIND`` times ``guided``**4 of that nearby. Chosen with
# 36 simulated scans for the least CRPS. Squares are averaged over ``AVERAGED_NODES``.
CONTRAST, GATHERED, BEHIND, AVERAGED_NODES = 0.1, 2.5, 1.25, 0.75

# Surroundings of a node: a Gaussian of this part of the side of the image, over twice the size of a lobe of
# tissue. Rays are counted within ``RAYS_NODES``.
SURROUNDINGS, RAYS_NODES = 0.063, 0.75

# Above these an image is called into question: misfit over noise; misfit in crossing times of a node, below
# which there are errors of the grid; contrast where rays gather over all contrast; and how much slower than
# the water a tenth of the object is, relative to the water. Chosen with the same scans and one of Table 6.
MISFIT_OVER_NOISE, MISFIT_CROSSING, GUIDED, SLOWER = 1.9, 0.05, 0.5, 0.055

# Nodes whose speed differs from that of water by less than this part of it are no object.
WATER_PART = 0.005


@dataclass(frozen=True)
class ModelErrors:
    """Errors of the model that follow from an image and its misfit.

    Attributes:
        contrast: as the image, m/s: difference of each node to its surroundings.
        excess: as the image: relative excess of rays over the surroundings, at least 0.
        guided: root mean square of contrast times relative excess of rays, over that of contrast: about 0
            without layers that guide rays.
        slower: relative to the speed of water, of the slowest tenth of the object; at least 0.
        noise_s: standard deviation of the times, s; 0 if it is not known.
        misfit_s: root mean square of the misfit, s, at least ``noise_s``.
        crossing_s: of a node at the speed of water, s.
    """

    contrast: Floats
    excess: Floats
    guided: float
    slower: float
    noise_s: float
    misfit_s: float
    crossing_s: float

    @classmethod
    def from_misfit(
        cls,
        speed: Floats,
        region: Flags,
        density: Floats,
        noise_s: float,
        misfit_s: float,
        spacing: float,
        water_mps: float,
    ) -> ModelErrors:
        """Errors of an image.

        Args:
            speed: (nx, ny[, nz]), m/s.
            region: nodes that may change, at least one.
            density: nodes of ray through each node.
            noise_s, misfit_s: see the attributes.
            spacing: of the nodes, m.
            water_mps: speed of the water, m/s.
        """
        contrast = speed - around(speed, SURROUNDINGS * (max(speed.shape) - 1))
        square = float((contrast[region] ** 2).mean())
        excess = _excess(density, region)
        gathered = float(((contrast * excess)[region] ** 2).mean())
        slowness = 1.0 - speed[region] / water_mps
        of_object = slowness[np.abs(slowness) > WATER_PART]
        return cls(
            contrast,
            excess,
            float(np.sqrt(gathered / square)) if square > 0.0 else 0.0,
            max(float(np.quantile(of_object, 0.9)), 0.0) if of_object.size else 0.0,
            noise_s,
            misfit_s,
            spacing / water_mps,
        )

    def added_to(self, squares: Floats) -> Floats:
        """Expected squares of the errors, (m/s)², from those of the posterior."""
        wrong = self.contrast**2
        averaged = around(squares + CONTRAST * wrong, AVERAGED_NODES)
        behind = around(wrong, 0.5 * SURROUNDINGS * (max(wrong.shape) - 1))
        return np.asarray((1.0 + self.excess) ** GATHERED * averaged + BEHIND * self.guided**4 * behind)

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
        if self.slower >= SLOWER:
            reasons.append(
                f"a tenth of the object is slower than the water by {100.0 * self.slower:.1f} % or more, so "
                "that first arrivals may go around it and tell nothing about it"
            )
        if not reasons:
            return ""
        return f"The standard deviations may be too small: {'; and '.join(reasons)}."


def _excess(density: Floats, region: Flags) -> Floats:
    """Relative excess of rays over the surroundings, at least 0."""
    radius = SURROUNDINGS * (max(density.shape) - 1)
    rays = np.where(region, density, 0.0)
    nearby = around(rays, radius) / np.maximum(around(region.astype(float), radius), 1e-9)
    return np.maximum(around(rays, RAYS_NODES) / np.maximum(nearby, 1e-9) - 1.0, 0.0)


def around(image: Floats, radius: float) -> Floats:
    """The image averaged over a Gaussian of this standard deviation, nodes."""
    return np.asarray(gaussian_filter(image, radius, mode="nearest"))
