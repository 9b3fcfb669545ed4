"""Samples of the posterior of the linearised problem, by solving it for perturbed data and prior.

The change u of the image, s of crossing time a node, has the prior u = D·v: D holds a standard deviation for
each node, and v is a stationary field of unit variance with exponential correlation. With v = F·w, where F is
the square root of its covariance in the cosine transform, w is white, and with B = Σ^(−½)·A·G·D·F the data
are B·w + white noise. The solution of (1 + Bᵀ·B)·w = Bᵀ·ε + ξ for white ε and ξ has the covariance
(1 + Bᵀ·B)⁻¹ of the posterior (perturb and maximise: Papandreou and Yuille 2010; randomise then optimise:
Bardsley et al. 2014); ξ = 0 and the residuals in place of ε give its mean.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from scipy.fft import dctn, idctn
from scipy.ndimage import gaussian_filter1d

from ...arrays import Floats
from ..gauss_newton.linear_problem import CURVATURE
from ..gauss_newton.linearisation import Map, Rows, halves, map_halves
from ..gauss_newton.penalties import roughness
from .probe_product import LANES, back_projections, normal_products

# Most conjugate gradient steps, and the relative gradient at which they end; more did not better the score.
MAX_STEPS, TOLERANCE = 20, 1e-2


@dataclass(frozen=True)
class Posterior:
    """The linearised problem with Gaussian noise and prior.

    Attributes:
        parts: rows of A, in nodes, and residuals, s.
        weights: of each part, (rays,), 1/s²: inverse variances of the residuals.
        deviation: (nx, ny[, nz]), s, of the prior at each node; 0 where nothing may change.
        correlation: length of the prior's exponential correlation, nodes.
        density: mean nodes of ray through a node that may change.
        width: standard deviation of the Gaussian G across rays, nodes.
    """

    parts: Sequence[Rows]
    weights: Sequence[Floats]
    deviation: Floats
    correlation: float
    density: float
    width: float = 0.0

    def solutions(self, noise: Sequence[Floats], prior: Floats) -> Floats:
        """Solutions for the given noise and prior fields.

        Args:
            noise: of each part, (rays, LANES), s.
            prior: (LANES, nx, ny[, nz]), standard normal, in the cosine transform.

        Returns:
            (LANES, nx, ny[, nz]), changes of the image, s of crossing time.
        """
        into = np.zeros((self.deviation.size, LANES))
        for block, weight, values in zip(self.parts, self.weights, noise, strict=True):
            back_projections(block.matrix, weight[:, None] * values, into)
        with map_halves(self.parts) as spread:
            return self._image(self._solved(prior + self._coefficients(into), spread))

    def _solved(self, right: Floats, spread: Map) -> Floats:
        """w of each lane by preconditioned conjugate gradients, each lane with its own steps."""
        solution, residual = np.zeros_like(right), right
        direction = self._precondition * residual
        square = self._dot(residual, direction)
        enough = TOLERANCE**2 * square
        for _ in range(MAX_STEPS):
            if (square <= enough).all():
                break
            bent = direction + self._curvature(direction, spread)
            step = square / np.maximum(self._dot(direction, bent), 1e-300)
            solution = solution + step * direction
            residual = residual - step * bent
            preconditioned = self._precondition * residual
            before, square = square, self._dot(residual, preconditioned)
            direction = preconditioned + square / np.maximum(before, 1e-300) * direction
        return solution

    def _curvature(self, coefficients: Floats, spread: Map) -> Floats:
        """Bᵀ·B·w."""
        image = self._blurred(self._image(coefficients))
        probes = np.ascontiguousarray(image.reshape(LANES, -1).T)
        into = np.sum(list(spread(partial(_products, probes), *self._halves)), axis=0)
        return self._coefficients(into)

    def _image(self, coefficients: Floats) -> Floats:
        """D·F·w."""
        return np.asarray(self.deviation * idctn(self._root * coefficients, axes=self._axes, norm="ortho"))

    def _coefficients(self, back_projected: Floats) -> Floats:
        """Fᵀ·D·G of a back-projection, (nodes, LANES)."""
        image = self._blurred(back_projected.T.reshape(LANES, *self.deviation.shape))
        return np.asarray(self._root * dctn(self.deviation * image, axes=self._axes, norm="ortho"))

    def _blurred(self, images: Floats) -> Floats:
        """Like ``finite_frequency.blurred`` for each lane."""
        if self.width > 0.0:
            for axis in self._axes:
                images = gaussian_filter1d(images, self.width, axis=axis, mode="constant")
        return images

    def _dot(self, first: Floats, other: Floats) -> Floats:
        return np.asarray((first * other).sum(axis=self._axes, keepdims=True))

    @property
    def _axes(self) -> tuple[int, ...]:
        return tuple(range(1, self.deviation.ndim + 1))

    @cached_property
    def _halves(self) -> tuple[list[list[Rows]], list[list[Floats]]]:
        """The rows in two halves, and their weights: sums have the same bits by one thread or two."""
        cut, flat, begin = halves(self.parts), np.concatenate(self.weights), 0
        weights: list[list[Floats]] = []
        for half in cut:
            weights.append([])
            for block in half:
                weights[-1].append(flat[begin : begin + block.residual.size])
                begin += block.residual.size
        return cut, weights

    @cached_property
    def _root(self) -> Floats:
        """Square root of the power spectrum of an exponential correlation, of unit variance."""
        squares = roughness(self.deviation.shape)
        power = (self.correlation**-2 + squares) ** (-0.5 * (self.deviation.ndim + 1))
        return np.asarray(np.sqrt(power / power.mean()))

    @cached_property
    def _precondition(self) -> Floats:
        """Inverse Hessian for rays from all sides through a prior of the mean variance."""
        squares = roughness(self.deviation.shape)
        squares.flat[0] = squares.flat[1]
        weight = float(np.concatenate(self.weights).mean())
        variance = float((self.deviation[self.deviation > 0.0] ** 2).mean())
        data = weight * variance * self.density * CURVATURE / np.sqrt(squares)
        return np.asarray(1.0 / (1.0 + self._root**2 * data))


def _products(probes: Floats, half: Sequence[Rows], weights: Sequence[Floats]) -> Floats:
    into = np.zeros_like(probes)
    for block, weight in zip(half, weights, strict=True):
        normal_products(block.matrix, weight, probes, into)
    return into
