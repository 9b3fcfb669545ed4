"""The linearised problem with total variation: fewest and straightest edges that explain the times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Flags, Floats
from .linearisation import Rows
from .matrix import back_project, normal_product

# Weight of the split in the alternating direction method, in units of the data's own curvature; on Table 6 a
# tenth of it ended with a worse image.
PENALTY = 0.75

# Rounds of splitting, and conjugate gradient steps in each, which begin at the last round's image. They do
# not reach the minimum; the next iteration goes on from the dual variable. A strength above every slope of
# the image acts like one as large as the slopes.
ROUNDS = 12
STEPS = 6


@dataclass(frozen=True)
class Linearised:
    """½·Σ (A·δ − residual)² / density + strength·Σ|∇(image + δ)|, δ = 0 outside the region.

    Attributes:
        parts: rows of A, in nodes, and residuals, s.
        image: (n, n), crossing time of a node: slowness times spacing, s.
        density: nodes of ray through a node of the region, on average.
        region: (n, n), nodes that may change.
        bounds: lowest and highest crossing time, s.
        strength: of the total variation, s: about the error of a travel time that an edge less may cost.
    """

    parts: Sequence[Rows]
    image: Floats
    density: float
    region: Flags
    bounds: tuple[float, float]
    strength: float

    def solve(self, dual: Floats) -> tuple[Floats, Floats]:
        """An image nearer its minimum, and the dual variable that a later, similar problem goes on from.

        The alternating direction method of multipliers (Boyd et al. 2011, section 6.4.1): a quadratic
        problem by conjugate gradients, then every gradient shrunk by itself. Bounds are kept by clipping.

        Args:
            dual: (2, n, n), s; zeros at first.
        """
        if not self.density > 0.0:
            return self.image, dual
        image = self.image.copy()
        downhill = self._downhill()
        # Without edges to cost anything, there is nothing to split.
        penalty = PENALTY if self.strength > 0.0 else 0.0
        for _ in range(ROUNDS):
            slope = gradient(image) + dual
            edges = shrink(slope, self.strength / PENALTY)
            dual = slope - edges
            # Of the quadratic problem at the image as it is.
            change = image - self.image
            steepest = downhill - self._curvature(change) - penalty * adjoint(gradient(image) - edges + dual)
            image = np.clip(image + self._conjugate_gradients(steepest, penalty), *self.bounds)
        return image, dual

    def _downhill(self) -> Floats:
        """Aᵀ·residual / density in the region."""
        into = np.zeros(self.image.size)
        for part in self.parts:
            back_project(part.pointers, part.columns, part.lengths, part.residual, into)
        return np.where(self.region, into.reshape(self.image.shape) / self.density, 0.0)

    def _curvature(self, change: Floats) -> Floats:
        """Aᵀ·A·change / density in the region."""
        into = np.zeros(self.image.size)
        for part in self.parts:
            normal_product(part.pointers, part.columns, part.lengths, change.ravel(), into)
        return np.where(self.region, into.reshape(self.image.shape) / self.density, 0.0)

    def _conjugate_gradients(self, steepest: Floats, penalty: float) -> Floats:
        """A change for which the gradient has nearly vanished, from ``STEPS`` steps."""
        residual = np.where(self.region, steepest, 0.0)
        change = np.zeros_like(residual)
        direction = residual
        square = float((residual**2).sum())
        for _ in range(STEPS):
            if square <= 0.0:
                break
            bent = self._curvature(direction)
            bent = bent + penalty * np.where(self.region, adjoint(gradient(direction)), 0.0)
            length = square / float((direction * bent).sum())
            change = change + length * direction
            residual = residual - length * bent
            before, square = square, float((residual**2).sum())
            direction = residual + (square / before) * direction
        return change


def gradient(image: Floats) -> Floats:
    """Forward differences along both axes, (2, n, m); 0 beyond the last node."""
    slope: Floats = np.zeros((2, *image.shape))
    slope[0, :-1] = image[1:] - image[:-1]
    slope[1, :, :-1] = image[:, 1:] - image[:, :-1]
    return slope


def adjoint(slope: Floats) -> Floats:
    """The adjoint of ``gradient``, (n, m)."""
    image: Floats = np.zeros(slope.shape[1:])
    image[1:] += slope[0, :-1]
    image[:-1] -= slope[0, :-1]
    image[:, 1:] += slope[1, :, :-1]
    image[:, :-1] -= slope[1, :, :-1]
    return image


def shrink(slope: Floats, by: float) -> Floats:
    """Each gradient shortened by ``by``, none below 0."""
    size = np.hypot(slope[0], slope[1])
    return np.asarray(slope * np.maximum(1.0 - by / np.maximum(size, 1e-300), 0.0))
