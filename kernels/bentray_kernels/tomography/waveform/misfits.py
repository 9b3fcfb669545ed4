"""Misfits of simulated and recorded traces, and their derivatives by every simulated sample."""

from typing import Protocol

import numpy as np

from ...arrays import Floats


class Misfit(Protocol):
    """A misfit: its value, and (nrx, nt) its derivative by every sample of the simulated traces."""

    def __call__(self, simulated: Floats, recorded: Floats, weight: Floats) -> tuple[float, Floats]: ...


def least_squares(simulated: Floats, recorded: Floats, weight: Floats) -> tuple[float, Floats]:
    """Half the weighted sum of squared differences over that of the recorded traces.

    Args:
        simulated, recorded: (nrx, nt).
        weight: (nrx, nt) or (nrx, 1), >= 0.
    """
    energy = float((weight * recorded**2).sum()) or 1.0
    gap = simulated - recorded
    return 0.5 * float((weight * gap**2).sum()) / energy, weight * gap / energy


def correlation(simulated: Floats, recorded: Floats, weight: Floats) -> tuple[float, Floats]:
    """One minus the normalised correlation, averaged over traces; independent of the amplitude of each trace.

    The gains of emitters and receivers are so projected out. Where the source is estimated anew from the same
    traces (``source_estimation``), the misfit is also blind to a filter that all traces have in common.

    Args:
        simulated, recorded: (nrx, nt).
        weight: (nrx, nt) or (nrx, 1), >= 0; both traces are windowed by its square root.
    """
    window = np.sqrt(weight)
    s, d = window * simulated, window * recorded
    size = np.sqrt((s**2).sum(axis=1) * (d**2).sum(axis=1))
    alive = size > 0.0
    count = max(int(alive.sum()), 1)
    both = np.where(alive, size, 1.0)
    alike = np.where(alive, (s * d).sum(axis=1) / both, 1.0)
    power = np.where(alive, (s**2).sum(axis=1), 1.0)
    slope = window * (s * (alike / power)[:, None] - d / both[:, None])
    return float((1.0 - alike).sum() / count), np.where(alive[:, None], slope / count, 0.0)


def arrival_window(arrival_s: Floats, times_s: Floats, before_s: float, after_s: float) -> Floats:
    """A window around the predicted arrival of each trace, (nrx, nt): 1 inside, half a cosine at its ends.

    Args:
        arrival_s: (nrx,), s.
        times_s: (nt,), of the samples, s.
        before_s, after_s: reach, s; the ends fall within the last quarter of each.
    """
    late = times_s[None, :] - arrival_s[:, None]
    reach = np.where(late < 0.0, -late / before_s, late / after_s)
    fall = np.clip((reach - 0.75) / 0.25, 0.0, 1.0)
    return np.asarray(0.5 * (1.0 + np.cos(np.pi * fall)))
