"""Inverted polarity: elements whose water pulses have the opposite sign."""

import math
from collections.abc import Iterator

import numpy as np

from ...arrays import Floats
from ..dataset import Dataset
from .finding import ROLES, Finding

# Periods before and after the maximum of the envelope that are compared.
REACH = 1.0

# Fraction of an element's pulses that must be inverted.
MIN_FRACTION = 0.6

# Fewest pulses of an element for a decision.
MIN_PAIRS = 4


def find_inverted(dataset: Dataset, sign: Floats) -> Iterator[Finding]:
    """Find elements with inverted polarity, in emission and in reception.

    Args:
        dataset: of one slice, channels in their places.
        sign: (ntx, nrx), correlation with the usual pulse, from -1 to 1; NaN where unknown. See
            ``water_signs``, and ``reference.chord_signs`` without a water shot.
    """
    # Alternate, so that an inverted receiver does not make the emitters appear inverted.
    emission, reception = np.ones(len(dataset.tx)), np.ones(len(dataset.rx))
    for _ in range(4):
        emission = _majority(sign * reception[None, :], 1)
        reception = _majority(sign * emission[:, None], 0)
    of_roles, elements = (emission, reception), (dataset.tx, dataset.rx)
    for role, of_role, element in zip(ROLES, of_roles, elements, strict=True):
        wrong = np.flatnonzero(of_role < 0.0)
        if wrong.size:
            yield Finding(
                "polarity",
                f"{wrong.size} inverted in {role}",
                "pulses as those of most elements",
                "corrected",
                tuple(element[wrong].tolist()),
                role,
                value=float(wrong.size),
                unit="elements",
            )


def water_signs(dataset: Dataset, strongest_s: Floats) -> Floats:
    """(ntx, nrx): correlation with the median pulse in water, from -1 to 1; NaN without a pulse.

    Pulses are aligned at the maxima of their envelopes, which do not depend on polarity or position errors.

    Args:
        dataset: of one slice, with water traces, channels in their places, and a centre frequency.
        strongest_s: (ntx, nrx), times of the maxima; NaN where there is none.
    """
    period, water = dataset.rate_hz / dataset.frequency_hz, dataset.traces.water_traces
    reach = math.ceil(REACH * period)
    # Traces without a maximum are not compared; any position will do.
    sample = np.where(np.isfinite(strongest_s), strongest_s, dataset.t0_s) - dataset.t0_s
    sample *= dataset.rate_hz
    nt = water.shape[-1]
    pieces = np.full((*sample.shape, 2 * reach + 1), np.nan)
    steps = np.arange(-reach, reach + 1)
    for e in range(len(sample)):
        at = sample[e][:, None] + steps
        inside = (at[:, 0] >= 0.0) & (at[:, -1] <= nt - 2) & np.isfinite(strongest_s[e])
        low = np.clip(np.floor(at).astype(np.int64), 0, nt - 2)
        trace = np.array(water[e], dtype=np.float64)
        trace[~np.isfinite(trace).all(axis=1)] = 0.0
        trace = trace - np.median(trace, axis=1, keepdims=True)
        left, right = (np.take_along_axis(trace, low + k, axis=1) for k in (0, 1))
        piece = left + (at - low) * (right - left)
        size = np.linalg.norm(piece, axis=1)
        good = inside & (size > 0.0) & np.isfinite(size)
        pieces[e][good] = piece[good] / size[good][:, None]
    finite = np.isfinite(pieces[..., 0])
    if not finite.any():
        return np.full(sample.shape, np.nan)
    common = np.median(pieces[finite], axis=0)
    size = float(np.linalg.norm(common))
    return np.asarray(pieces @ (common / size)) if size > 0.0 else np.full(sample.shape, np.nan)


def _majority(sign: Floats, axis: int) -> Floats:
    """-1 for rows (axis 1) or columns (axis 0) of which most are inverted, else 1."""
    finite = np.isfinite(sign)
    down = ((sign < -0.3) & finite).sum(axis=axis) / np.maximum(finite.sum(axis=axis), 1)
    return np.where((down > MIN_FRACTION) & (finite.sum(axis=axis) >= MIN_PAIRS), -1.0, 1.0)
