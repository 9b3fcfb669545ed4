"""First-arrival picking of a whole scan: travel time object minus water from its traces."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...errors import InvalidInput
from ...requests.names import DEFAULT_PICKER
from ..dataset import Dataset, Floats
from .consistency import consistent
from .differential import emission
from .pickers import PICKERS, picker_named
from .pulse import Inverse

__all__ = ["PICKERS", "pick"]

# Standard deviation of rounding to whole numbers.
ROUNDING = 1.0 / math.sqrt(12.0)


def pick(
    dataset: Dataset,
    picker: str = DEFAULT_PICKER,
    progress: Callable[[int, int], None] | None = None,
    *,
    screened: bool = True,
) -> Dataset:
    """Pick the travel times of a scan from its traces.

    The water and the object trace of a pair are picked in the same way, so that the shape of the pulse
    and the delay of the electronics cancel. The water onset is searched around the straight time at the
    water's speed, the object onset in the range of speeds from 1300 to 1700 m/s. The delay between the two
    is then refined: the first one and a half periods of the water pulse are correlated with the object
    trace, to a fraction of a sample. Pairs are omitted (NaN) if they are nearer than two wavelengths, have
    no pulse above four times the noise, a low correlation with the water pulse, or differ from their
    neighbours or reciprocal pair by more than half a period.

    The standard deviation assumes that the noise averages out over the pulse, and that all other differences
    of object and water pulse are fully correlated, at the centre frequency; see
    ``cross_correlation.delay_deviation``.

    Args:
        dataset: with traces of object and water, a sampling rate and a centre frequency.
        picker: method of the onset, see ``picking.pickers.PICKERS``.
        progress: called with (emissions done, emissions in all).
        screened: whether to remove inconsistent picks; ``quality`` keeps them for its report.

    Returns:
        The dataset with ``delta_tof_s``, ``sigma_s`` and ``picker`` set, and without its traces and any
        older absolute travel times.

    Raises:
        InvalidInput: for an unknown picker, or a dataset that lacks one of the above.
    """
    picker_named(picker)
    require_traces(dataset)
    nz, every = dataset.slices, range(len(dataset.tx))
    readings = []
    for k in range(nz):
        slice_data = dataset.slice(k)

        def done(e: int, k: int = k) -> None:
            if progress is not None:
                progress(k * len(every) + e + 1, nz * len(every))

        times = read_times(slice_data, every, picker, done)
        readings.append(screen_times(slice_data, *times, screened=screened))
    delta, sigma = (np.stack(both) for both in zip(*readings, strict=True))
    if dataset.slice_z_m is None:
        delta, sigma = delta[0], sigma[0]
    return replace(dataset, delta_tof_s=delta, sigma_s=sigma, tof_s=None, picker=picker, waveform=None)


def read_times(
    dataset: Dataset,
    emissions: Sequence[int],
    picker: str,
    done: Callable[[int], None] = lambda e: None,
) -> tuple[Floats, Floats]:
    """Pick some emissions, without consistency checks between pairs.

    Args:
        dataset: of one slice, see ``pick``; its traces may be ``Emissions``.
        emissions: indices, from 0.
        picker: one of ``PICKERS``.
        done: called after each.

    Returns:
        Object minus water and its standard deviation, (emissions, nrx), s; NaN without an arrival.
    """
    chosen, traces, position = picker_named(picker), dataset.traces, dataset.element_position_m
    inverse = Inverse.from_dataset(dataset) if chosen.filtered else None
    scan = dataset.water_speed_mps, dataset.rate_hz, dataset.t0_s, dataset.frequency_hz
    speed, rate, start, frequency = map(float, scan)
    delta = np.empty((len(emissions), len(dataset.rx)))
    sigma = np.empty_like(delta)
    for row, e in enumerate(emissions):
        rounding = ROUNDING if traces.object.dtype.kind == "i" else 0.0
        object_, water = (np.ascontiguousarray(t[e]) for t in (traces.object, traces.water_traces))
        if inverse is not None:
            object_, water, rounding = inverse(object_), inverse(water), inverse.gain * rounding
        distance = np.linalg.norm(position[dataset.rx] - position[dataset.tx[e]], axis=1)
        settings = speed, rate, start, frequency, rounding, chosen.code
        emission(object_, water, distance, *settings, delta[row], sigma[row])
        done(e)
    return delta, sigma


def screen_times(dataset: Dataset, delta: Floats, sigma: Floats, *, screened: bool) -> tuple[Floats, Floats]:
    """Remove the times of invalid pairs, and optionally of inconsistent ones, from a slice.

    Args:
        dataset: of one slice.
        delta, sigma: (ntx, nrx), s, as ``read_times`` gives them.
        screened: see ``pick``.

    Returns:
        Copies, with NaN for removed times.
    """
    delta = delta.copy()
    if dataset.valid is not None:
        delta[~dataset.valid] = np.nan
    delta[dataset.tx[:, None] == dataset.rx[None, :]] = np.nan
    if screened:
        delta = consistent(dataset, delta)
    return delta, np.where(np.isfinite(delta), sigma, np.nan)


def require_traces(dataset: Dataset, *, water: bool = True) -> None:
    """Check that a dataset has what picking requires.

    Args:
        dataset: the scan.
        water: whether a water shot is required; without one it can be estimated, see ``reference``.

    Raises:
        InvalidInput: naming the first missing field.
    """
    if dataset.waveform is None:
        raise InvalidInput("waveform/object", "no traces", "traces to pick from")
    if water and dataset.waveform.water is None:
        raise InvalidInput("waveform/water", "no traces", "the same scan without the object, to compare with")
    if dataset.center_frequency_hz is None:
        raise InvalidInput(
            "acquisition@center_frequency_hz", "nothing", "the centre frequency of the pulse, Hz"
        )
