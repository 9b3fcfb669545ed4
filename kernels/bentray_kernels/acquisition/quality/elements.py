"""Elements with a clock offset, and displaced elements, by the times of chords through water."""

from collections.abc import Iterator

import numpy as np

from ...arrays import Floats, Ints
from ..dataset import Dataset
from ..noise import robust_deviation
from .element_errors import fit_element_errors
from .finding import ROLES, Finding

CLOCK, DISPLACED = "clock offset", "displaced elements"

# Smallest delay and displacement that are reported, periods and wavelengths, and multiples of the usual ones.
MIN_DELAY, MIN_DISPLACEMENT, UNUSUAL = 0.1, 0.08, 6.0

# Largest part of the elements: if more deviate, the drawing of the array is wrong, which is another finding.
MAX_PART = 0.4


def find_element_errors(dataset: Dataset, residual_s: Floats) -> Iterator[Finding]:
    """Find modules whose clock is late or early, and elements away from their stated positions.

    Args:
        dataset: of one slice, channels in their places, with a centre frequency.
        residual_s: (ntx, nrx), s: times in water minus those of the stated positions; NaN where unknown.
    """
    if dataset.element_position_m.shape[1] != 2:
        return
    errors = fit_element_errors(dataset, residual_s)
    least_s = MIN_DELAY / dataset.frequency_hz
    delays = errors.emission_delay_s, errors.reception_delay_s
    for role, delay, sigma in zip(ROLES, delays, errors.sigma_s.T[2:], strict=True):
        off = delay - np.nanmedian(delay) if np.isfinite(delay).any() else delay
        for run in _runs(_unusual(off, sigma, least_s), off):
            value = float(np.median(off[run]))
            late = f"{'late' if value > 0.0 else 'early'} by {1e9 * abs(value):.0f} ns"
            yield Finding(
                CLOCK,
                f"{_named(run)} {late} in {role}",
                f"within {1e9 * least_s:.0f} ns, a tenth of a period",
                "reported",
                tuple(run.tolist()),
                role,
                value=value,
                unit="s",
            )
    distance = np.linalg.norm(errors.displacement_m, axis=1)
    least_m = MIN_DISPLACEMENT * dataset.water_speed_mps / dataset.frequency_hz
    sigma_m = np.hypot(*errors.sigma_s[:, :2].T) * dataset.water_speed_mps
    displaced = _unusual(distance, sigma_m, least_m)
    if displaced.size:
        farthest = float(distance[displaced].max())
        yield Finding(
            DISPLACED,
            f"{_named(displaced)} {1e3 * farthest:.2g} mm from the stated position",
            f"within {1e3 * least_m:.2g} mm; see bentray quality --calibrate",
            "reported",
            tuple(displaced.tolist()),
            value=farthest,
            unit="m",
        )


def _unusual(values: Floats, sigma: Floats, least: float) -> Ints:
    """Indices of values far from the usual ones, and certain; none where most are."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return np.array([], dtype=np.int64)
    beyond = np.abs(values) > max(least, float(np.median(finite)) + UNUSUAL * robust_deviation(finite))
    beyond &= np.abs(values) > UNUSUAL * sigma
    return np.flatnonzero(beyond) if beyond.sum() <= MAX_PART * finite.size else np.array([], dtype=np.int64)


def _runs(indices: Ints, values: Floats) -> list[Ints]:
    """Neighbouring elements with deviations of the same sign, together."""
    if not indices.size:
        return []
    breaks = (np.diff(indices) > 1) | (np.diff(np.sign(values[indices])) != 0.0)
    return list(np.split(indices, np.flatnonzero(breaks) + 1))


def _named(elements: Ints) -> str:
    """Elements in words."""
    if elements.size == 1:
        return f"element {elements[0]} is"
    if elements[-1] - elements[0] == elements.size - 1:
        return f"elements {elements[0]} to {elements[-1]} are"
    return f"{elements.size} elements are"
