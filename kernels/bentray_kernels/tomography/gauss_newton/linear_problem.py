"""The linear problem of a Gauss–Newton step: least squares with Huber loss and a penalty."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from scipy.fft import dctn, idctn

from ...arrays import Flags, Floats
from ..finite_frequency import blurred
from . import huber
from .linearisation import Map, Rows, halves, map_halves
from .penalties import Penalty, adjoint, gradient, laplacian, length, roughness, shrink
from .ray_matrix import normal_product

# Weight of the splitting in the alternating direction method, in units of the curvature of the data; on Table
# 6 a tenth of it gave a worse image.
SPLIT = 0.75

# Rounds of splitting, and conjugate gradient steps in each, which start from the image of the previous round.
# They do not reach the minimum; the next iteration starts from the dual variable. A strength above every
# slope of the image acts like one as large as the slopes.
ROUNDS = 12
STEPS = 6

# Most conjugate gradient steps of a quadratic penalty, and the relative gradient at which they end.
MAX_STEPS = 300
TOLERANCE = 1e-5

# Curvature of the data over the density at a wavenumber k of 1/node, times k: rays from all sides of a plane
# blur a point to 1/(π·distance), whose transform is 2/k.
CURVATURE = 2.0

# Solutions of a quadratic penalty with Huber loss, each with weights from the residuals of the previous one.
REWEIGHTINGS = 4


def smoothing(wavenumber: float) -> float:
    """Strength of a ``laplacian`` that outweighs data from all sides beyond a wavenumber of 1/node."""
    return CURVATURE / wavenumber**5


@dataclass(frozen=True)
class Linearised:
    """Σ ρ(A·δ − residual) / density + a penalty of image + δ, with δ = 0 outside the region.

    ρ(e) is ½·e², beyond ``huber`` huber·(|e| − ½·huber). The penalty of an image u is, with g for strength,
    g·Σ|∇u| (``total-variation``; see ``edge``), ½·g·Σ(Δu)² (``laplacian``) or ½·g·Σ(u − reference)²
    (``tikhonov``). Node differences are not divided by the spacing.

    Attributes:
        parts: rows of A, in nodes, and residuals, s.
        image: (nx, ny[, nz]), crossing time of a node: slowness times spacing, s.
        density: mean nodes of ray through a node of the region.
        region: as the image, nodes that may change.
        bounds: lowest and highest crossing time, s.
        strength: of the penalty; for total variation in s, about the error of a travel time that one edge
            less may cost; for the others dimensionless: 1 has the mean weight of the data.
        penalty: its name.
        huber: s; rows with larger residuals have less weight.
        reference: as the image, s, of the ``tikhonov`` penalty; None: the image.
        edge: of total variation, s: the penalty of a slope is g·edge·log(1 + |∇u|/edge), so that well above
            ``edge`` the penalty hardly increases and edges keep their contrast. Iteratively reweighted
            (Candès, Wakin and Boyd 2008): each ``solve`` weighs the slopes by those of ``image``, so that one
            call is a convex problem; without slopes, and for ``inf``, it is plain total variation.
        width: standard deviation of the Gaussian G across rays, nodes: A·δ above is then A·G·δ.
    """

    parts: Sequence[Rows]
    image: Floats
    density: float
    region: Flags
    bounds: tuple[float, float]
    strength: float
    penalty: Penalty = "total-variation"
    huber: float = math.inf
    reference: Floats | None = None
    edge: float = math.inf
    width: float = 0.0

    def solve(self, dual: Floats) -> tuple[Floats, Floats]:
        """An image nearer the minimum, clipped to the bounds, and the dual variable for the next problem.

        Args:
            dual: (ndim, nx, ny[, nz]), s; initially zeros. Quadratic penalties return it unchanged.
        """
        if not self.density > 0.0:
            return self.image, dual
        if self.penalty == "total-variation" and self.strength > 0.0:
            with map_halves(self.parts) as spread:
                return self._split(spread, dual)
        image, steps = self.image, MAX_STEPS
        with map_halves(self.parts) as spread:
            for _ in range(REWEIGHTINGS if self.huber < math.inf else 1):
                steepness = self._penalty_gradient(image)
                image = self._descend(spread, image, steepness, self._penalty_hessian, steps)
        return image, dual

    @cached_property
    def _halves(self) -> list[list[Rows]]:
        return halves(self.parts)

    def _split(self, spread: Map, dual: Floats) -> tuple[Floats, Floats]:
        """The alternating direction method of multipliers (Boyd et al. 2011, section 6.4.1).

        Alternates between a quadratic problem, by conjugate gradients, and soft thresholding of the
        gradients.
        """
        image = self.image
        cost = self.strength / (1.0 + length(gradient(image)) / self.edge)
        for _ in range(ROUNDS):
            slope = gradient(image) + dual
            edges = shrink(slope, cost / SPLIT)
            dual = slope - edges
            steepness = SPLIT * adjoint(gradient(image) - edges + dual)
            image = self._descend(spread, image, steepness, _slope_hessian, STEPS)
        return image, dual

    def _penalty_gradient(self, image: Floats) -> Floats:
        """The gradient of a quadratic penalty."""
        reference = self.image if self.reference is None else self.reference
        return self._penalty_hessian(image - reference if self.penalty == "tikhonov" else image)

    def _penalty_hessian(self, change: Floats) -> Floats:
        """The second derivative of a quadratic penalty times a change."""
        if self.strength == 0.0:
            return np.zeros_like(change)
        return self.strength * (change if self.penalty == "tikhonov" else laplacian(laplacian(change)))

    def _descend(
        self,
        spread: Map,
        image: Floats,
        steepness: Floats,
        stiffness: Callable[[Floats], Floats],
        steps: int,
    ) -> Floats:
        """The image after conjugate gradient steps.

        Args:
            steepness: gradient of the quadratic term at the image; stiffness: its second derivative.
        """
        change = blurred(image - self.image, self.width)
        weights, downhill = zip(*spread(partial(self._back_projected, change), self._halves), strict=True)
        residual = self._on_image(np.sum(downhill, axis=0)) - np.where(self.region, steepness, 0.0)
        precondition = self._preconditioner()
        change, direction = np.zeros_like(residual), precondition(residual)
        square = float((residual * direction).sum())
        enough = TOLERANCE**2 * square
        for _ in range(steps):
            if square <= enough:
                break
            wide = blurred(direction, self.width).ravel()
            curved = np.sum(list(spread(partial(_curvature, wide), self._halves, weights)), axis=0)
            bent = self._on_image(curved) + np.where(self.region, stiffness(direction), 0.0)
            step = square / float((direction * bent).sum())
            change = change + step * direction
            residual = residual - step * bent
            preconditioned = precondition(residual)
            before, square = square, float((residual * preconditioned).sum())
            direction = preconditioned + (square / before) * direction
        return np.clip(image + change, *self.bounds)

    def _preconditioner(self) -> Callable[[Floats], Floats]:
        """A preconditioner for ``laplacian``: inverse Hessian of full-view data and penalty by wavenumber.

        The smoother the image, the slower the convergence without it.
        """
        if self.penalty != "laplacian":
            return lambda image: image
        squares = roughness(self.image.shape)
        squares.flat[0] = squares.flat[1]
        curvature = CURVATURE / np.sqrt(squares) + self.strength * squares**2
        return lambda image: np.where(self.region, idctn(dctn(image) / curvature), 0.0)

    def _on_image(self, flat: Floats) -> Floats:
        """A back-projection as an image, blurred to the ray width, over the density, in the region."""
        return np.where(self.region, blurred(flat.reshape(self.image.shape), self.width) / self.density, 0.0)

    def _back_projected(self, change: Floats, half: Sequence[Rows]) -> tuple[list[Floats], Floats]:
        """Weights of the rows of some parts, and their weighted residuals of an image back-projected."""
        weights, into = [], np.zeros(change.size)
        for block in half:
            residual = block.residual - block.project(change)
            weights.append(huber.weights(residual, self.huber))
            block.back_project(weights[-1] * residual, into)
        return weights, into


def _curvature(image: Floats, half: Sequence[Rows], weights: Sequence[Floats]) -> Floats:
    """Aᵀ·W·A·image of the rows of some parts, (nodes,), with weights by part."""
    into = np.zeros(image.size)
    for block, weight in zip(half, weights, strict=True):
        normal_product(block.matrix, weight, image, into)
    return into


def _slope_hessian(change: Floats) -> Floats:
    """The second derivative of the quadratic term of the splitting times a change."""
    return SPLIT * adjoint(gradient(change))
