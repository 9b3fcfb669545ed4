"""The finite-difference Laplacian: weights, longest stable time step, numerical dispersion."""

import math
from fractions import Fraction
from typing import Literal

import numpy as np

from ..arrays import Floats
from ..errors import InvalidInput

# Nodes on either side of the centre; the order in space is twice that.
HALO = 4


# Order in space, even and at most 8; or the weights that are optimised for waves of 3.3 nodes and more.
Order = int | Literal["optimised"]
OPTIMISED: Order = "optimised"
OPTIMISED_NODES = 3.3

# Distances 1 to 4. Of all weights that are exact for parabolas, these have the least largest relative error
# of the symbol for waves of 3.3 nodes and more: 0.07 %, so 0.035 % of the phase speed, of order 8 1.2 %
# (Holberg, Geophys. Prosp. 35, 1987, likewise; a test computes them by a linear program).
_OPTIMISED = (1.7341539559, -0.2763004294, 0.0524943305, -0.0063375758)


def weights(order: Order = 2 * HALO) -> Floats:
    """Weights of the second derivative at distances 0 to 4 nodes, times spacing squared, (5,).

    Polynomials up to degree ``order + 1`` are differentiated exactly; for equally spaced nodes the weights
    have a closed form (Fornberg, Math. Comp. 51, 1988).

    Args:
        order: 2, 4, 6, 8 or ``OPTIMISED``; of a lower one than 8 the outermost weights are 0.

    Raises:
        InvalidInput: any other order.
    """
    if order == OPTIMISED:
        return np.array([-2.0 * sum(_OPTIMISED), *_OPTIMISED])
    if not isinstance(order, int) or order not in range(2, 2 * HALO + 1, 2):
        raise InvalidInput("order", order, "2, 4, 6, 8 or optimised")
    m = order // 2
    sides = [
        Fraction(2 * (-1) ** (k + 1) * math.factorial(m) ** 2)
        / (k * k * math.factorial(m - k) * math.factorial(m + k))
        for k in range(1, m + 1)
    ]
    return np.array([float(w) for w in (-2 * sum(sides), *sides)] + [0.0] * (HALO - m))


def symbol(angle: Floats, order: Order = 2 * HALO) -> Floats:
    """Symbol of the stencil, which approximates ``angle**2``; ``angle`` is wave number times spacing."""
    centre, *sides = weights(order)
    turns = np.cos(np.asarray(angle)[..., None] * np.arange(1, HALO + 1))
    # Not below 0 by rounding.
    return np.asarray(np.maximum(-centre - 2.0 * turns @ np.array(sides), 0.0))


def longest_step(
    speed: float, spacing: float, damping: float = 0.0, dimensions: int = 2, order: Order = 2 * HALO
) -> float:
    """Longest stable time step, s.

    The scheme is stable while the phase of no mode advances by more than π per step: with the damping sigma,
    dt^2 (sigma^2 + d S c^2 / h^2) <= 4, where S is the symbol at the shortest wave and d the dimensions.

    Args:
        speed: the highest, m/s.
        spacing: of the nodes, m.
        damping: the highest rate sigma, 1/s.
        dimensions: 2 or 3.
        order: in space; the steps of lower orders than 8 are longer, those of ``OPTIMISED`` 5 % shorter.
    """
    shortest = float(symbol(np.array(math.pi), order))
    return 2.0 / math.sqrt(damping**2 + dimensions * shortest * (speed / spacing) ** 2)


def phase_error(
    points_per_wavelength: float, courant: float = 0.0, direction: float = 0.0, order: Order = 2 * HALO
) -> float:
    """Numerical phase speed over the true one, minus 1.

    Args:
        points_per_wavelength: nodes in a wavelength.
        courant: speed times time step over spacing; 0: error of the spatial stencil alone.
        direction: angle of travel to the x axis, rad.
        order: in space.
    """
    angle = 2.0 * math.pi / points_per_wavelength
    along = np.array([angle * math.cos(direction), angle * math.sin(direction)])
    turned = math.sqrt(float(symbol(along, order).sum()))
    if courant > 0.0:
        turned = 2.0 / courant * math.asin(0.5 * courant * turned)
    return turned / angle - 1.0


def numerical_frequency(
    wave_number: Floats, speed: float, spacing: float, time_step_s: float, order: Order = 2 * HALO
) -> Floats:
    """Angular frequency of the scheme for a wave number, averaged over directions, rad/s.

    Args:
        wave_number: any shape, rad/m, up to π per node.
        speed: m/s.
        spacing: m.
        time_step_s: s.
        order: in space.
    """
    # Directions are symmetric about 45° and repeat after 90°.
    angle = np.pi / 4.0 * (np.arange(16) + 0.5) / 16.0
    turn = np.asarray(wave_number)[..., None] * spacing
    size = np.sqrt(symbol(turn * np.cos(angle), order) + symbol(turn * np.sin(angle), order)).mean(axis=-1)
    half = 0.5 * speed * time_step_s / spacing * size
    return np.asarray(2.0 / time_step_s * np.arcsin(np.minimum(half, 1.0)))
