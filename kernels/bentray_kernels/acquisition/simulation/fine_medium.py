"""Medium of a simulated scan: speed and attenuation on a fine grid, and the arrivals through them."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from ...arrays import Floats, Ints
from ...eikonal import solve
from ...rays import sensitivities


@dataclass(frozen=True)
class FineMedium:
    """A medium on a fine grid; node 0 lies at 0.

    Attributes:
        speed: (nx, ny[, nz]), m/s.
        spacing: node spacing, m.
        coupling_mps: speed of the coupling water, m/s.
        attenuation: as ``speed``, Np/m; None without amplitudes.
        coupling_np_m: attenuation of that water, Np/m.
    """

    speed: Floats
    spacing: float
    coupling_mps: float
    attenuation: Floats | None = None
    coupling_np_m: float = 0.0

    def arrivals(self, elements: Floats, emitters: Ints) -> tuple[Floats, Floats | None]:
        """Arrivals at every element from some of them.

        Travel times are those of ``hafmm``, interpolated on the grid; inversions use other solvers and
        integrate along rays.

        Args:
            elements: (n, ndim), m, in the grid.
            emitters: (k,) indices into ``elements``.

        Returns:
            Object minus water travel time, (k, n), s, and ln(A_water / A_object), (k, n), Np, or None
            without attenuation; both 0 from an element to itself.
        """
        delta = np.empty((len(emitters), len(elements)))
        ratio = None if self.attenuation is None else np.empty_like(delta)
        for row, emitter in enumerate(emitters):
            source = elements[emitter]
            tof = solve(self.speed, self.spacing, source, "hafmm")
            distance = np.linalg.norm(elements - source, axis=1)
            delta[row] = read(tof, self.spacing, source, elements) - distance / self.coupling_mps
            delta[row, emitter] = 0.0
            if self.attenuation is not None and ratio is not None:
                ratio[row] = log_ratios(
                    tof, self.attenuation, self.spacing, elements, source, self.coupling_np_m
                )
                ratio[row, emitter] = 0.0
        return delta, ratio


def log_ratios(
    tof: Floats,
    attenuation: Floats,
    spacing: float,
    receivers: Floats,
    source: Floats,
    coupling_np_m: float = 0.0,
) -> Floats:
    """ln(A_water / A_object) of the arrivals from one source (the data of phase 2, chapter 6.3).

    Absorption only: ∫ α ds along the bent ray minus α_water times the straight distance. Focusing by
    refraction is not included.

    Args:
        tof: (nx, ny[, nz]), s, from the source.
        attenuation: as ``tof``, Np/m.
        spacing: node spacing, m.
        receivers: (k, ndim), m, in the grid; node 0 lies at 0.
        source: (ndim,), m.
        coupling_np_m: attenuation of the water of the scan without the object, Np/m.

    Returns:
        (k,), Np.

    Raises:
        InvalidInput: as ``rays.trace``.
    """
    through_object = sensitivities(tof, spacing, receivers, source) @ attenuation.ravel()
    straight = np.linalg.norm(receivers - source, axis=1)
    return np.asarray(through_object - coupling_np_m * straight)


def read(tof: Floats, spacing: float, source: Floats, points: Floats) -> Floats:
    """Travel time between the nodes: T over the distance is smooth, and is interpolated.

    Args:
        tof: (nx, ny[, nz]), s.
        spacing: node spacing, m.
        source: (ndim,), m; points: (k, ndim), m.

    Returns:
        (k,), s.
    """
    low = np.clip((points / spacing).astype(np.int64), 0, np.array(tof.shape) - 2)
    fraction = points / spacing - low
    mean_slowness = np.zeros(len(points))
    weight_sum = np.zeros(len(points))
    for corner in product((0, 1), repeat=tof.ndim):
        node = low + np.array(corner)
        distance = np.linalg.norm(node * spacing - source, axis=1)
        weight = np.prod(np.where(corner, fraction, 1.0 - fraction), axis=1)
        weight = np.where(distance > 0.0, weight, 0.0)
        mean_slowness += weight * tof[tuple(node.T)] / np.where(distance > 0.0, distance, 1.0)
        weight_sum += weight
    away = np.linalg.norm(points - source, axis=1)
    return np.asarray(away * mean_slowness / np.where(weight_sum > 0.0, weight_sum, 1.0))
