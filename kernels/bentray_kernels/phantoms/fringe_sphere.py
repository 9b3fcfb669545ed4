"""Glass balls: a sphere with a Gaussian fringe and air holes."""

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..errors import InvalidInput

Hole = tuple[tuple[float, float, float], float]


@dataclass(frozen=True)
class FringeSphere:
    """A ball of value 1 that fades outwards like a Gaussian (dissertation, 3.4.1 and 4.4.3).

    With G(d) = exp(−d²/2σ²) outside a sphere, d its distance, and 1 inside, the field is G of the ball times
    1 − G of each hole. A ``CubeField``.

    Attributes:
        radius: of the part whose value is 1, in half edges of the cube; the ball's centre is the cube's.
        fringe: σ, in half edges.
        holes: centre (x, y, z) and radius of each ball of air, within the sphere.

    Raises:
        InvalidInput: for a radius or fringe that is not above 0.
    """

    radius: float = 0.3
    fringe: float = 0.2
    holes: tuple[Hole, ...] = ()

    def __post_init__(self) -> None:
        holes = [("holes", radius) for _, radius in self.holes]
        for name, number in (("radius", self.radius), ("fringe", self.fringe), *holes):
            if not number > 0.0:
                raise InvalidInput(name, number, "a number above 0, in half edges of the cube")

    def value(self, points: Floats) -> Floats:
        """See ``CubeField.value``."""
        product, _ = self._fade(points, (0.0, 0.0, 0.0), self.radius)
        for centre, radius in self.holes:
            product = product * (1.0 - self._fade(points, centre, radius)[0])
        return product

    def gradient(self, points: Floats) -> Floats:
        """Like ``CubeField.gradient``; 0 where the field is constant."""
        product, slope = self._fade(points, (0.0, 0.0, 0.0), self.radius)
        for centre, radius in self.holes:
            fade, its_slope = self._fade(points, centre, radius)
            slope = slope * (1.0 - fade)[..., np.newaxis] - product[..., np.newaxis] * its_slope
            product = product * (1.0 - fade)
        return slope

    def iso_radius(self, iso: float) -> float:
        """Radius of the outer surface on which the field is ``iso``, between 0 and 1; exact without holes."""
        if not 0.0 < iso < 1.0:
            raise InvalidInput("iso", iso, "a number between 0 and 1")
        return self.radius + self.fringe * math.sqrt(-2.0 * math.log(iso))

    def _fade(
        self, points: Floats, centre: tuple[float, float, float], radius: float
    ) -> tuple[Floats, Floats]:
        """G and its gradient."""
        offset = points - np.array(centre)
        apart = np.linalg.norm(offset, axis=-1)
        outside = np.maximum(apart - radius, 0.0)
        value = np.exp(-0.5 * (outside / self.fringe) ** 2)
        along = -value * outside / (self.fringe**2 * np.maximum(apart, radius))
        return value, along[..., np.newaxis] * offset


# Glass balls as in figures 18 and 19, with one and two holes.
ONE_HOLE = FringeSphere(0.6, 0.06, (((0.0, 0.0, 0.0), 0.2),))
TWO_HOLES = FringeSphere(0.6, 0.06, (((-0.28, 0.0, 0.0), 0.1), ((0.28, 0.0, 0.0), 0.1)))
