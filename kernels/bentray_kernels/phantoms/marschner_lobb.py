"""The Marschner–Lobb test signal for interpolation filters."""

import math
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats


@dataclass(frozen=True)
class MarschnerLobb:
    """Rings about the z axis whose frequency is almost too high for a grid of 40 nodes a side.

    ρ = (1 − sin(πz/2) + α (1 + cos(2π f cos(πr/2)))) / (2 (1 + α)) with r² = x² + y², between 0 and 1, on the
    cube from −1 to 1 (Marschner & Lobb 1994, section 5; dissertation, 3.4.1). A ``CubeField``.

    Attributes:
        frequency: f.
        modulation: α.
    """

    frequency: float = 6.0
    modulation: float = 0.25

    def value(self, points: Floats) -> Floats:
        """See ``CubeField.value``."""
        phase = (
            2.0 * math.pi * self.frequency * np.cos(0.5 * math.pi * np.hypot(points[..., 0], points[..., 1]))
        )
        along = 1.0 - np.sin(0.5 * math.pi * points[..., 2])
        return np.asarray((along + self.modulation * (1.0 + np.cos(phase))) / (2.0 * (1.0 + self.modulation)))

    def gradient(self, points: Floats) -> Floats:
        """See ``CubeField.gradient``."""
        radius = np.hypot(points[..., 0], points[..., 1])
        turn = 2.0 * math.pi * self.frequency
        # sin(πr/2)/r is finite on the axis.
        slope = (
            turn * np.sin(turn * np.cos(0.5 * math.pi * radius)) * 0.25 * math.pi**2 * np.sinc(0.5 * radius)
        )
        gradient = np.empty(points.shape)
        gradient[..., :2] = self.modulation * slope[..., np.newaxis] * points[..., :2]
        gradient[..., 2] = -0.5 * math.pi * np.cos(0.5 * math.pi * points[..., 2])
        return gradient / (2.0 * (1.0 + self.modulation))
