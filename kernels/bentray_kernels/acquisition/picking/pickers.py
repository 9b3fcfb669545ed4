"""Onset pickers by name, and their common interface for compiled code."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from ...compilation.compiled import kernel
from ...errors import InvalidInput
from .energy_onsets import energy_ratio, sta_lta
from .onset import Trace, aic, first_strong, threshold

AIC, THRESHOLD, ENERGY_RATIO, STA_LTA, CORRELATION, MATCHED = range(6)

# Delay of the maximum of a filtered pulse after its onset, periods.
RISE = 0.5


@dataclass(frozen=True)
class Picker:
    """A method of picking first arrivals.

    Attributes:
        name: in requests.
        code: for compiled functions.
        summary: one line for help texts.
        filtered: whether traces are first deconvolved with the measured pulse.
    """

    name: str
    code: int
    summary: str
    filtered: bool = False


PICKERS: Mapping[str, Picker] = MappingProxyType(
    {
        p.name: p
        for p in (
            Picker("aic", AIC, "Akaike's criterion splits noise from signal"),
            Picker("threshold", THRESHOLD, "first crossing of a fifth of the peak, or four times the noise"),
            Picker("energy-ratio", ENERGY_RATIO, "steepest rise of Coppens' ratio of recent to all energy"),
            Picker("sta-lta", STA_LTA, "short over long average of the energy"),
            Picker("correlation", CORRELATION, "likeness with the water pulse, without an onset"),
            Picker("matched", MATCHED, "first crest after deconvolution with the measured pulse", True),
        )
    }
)


def picker_named(name: str) -> Picker:
    """The picker of that name.

    Raises:
        InvalidInput: listing the known names.
    """
    if name not in PICKERS:
        raise InvalidInput("picker", repr(name), "one of " + ", ".join(PICKERS))
    return PICKERS[name]


@kernel
def onset(x: Trace, begin: int, end: int, period: float, noise: float, picker: int) -> tuple[float, int]:
    """Onset of the first arrival in ``x[begin:end]`` and the sample of its largest extremum; NaN, −1 if none.

    ``CORRELATION`` finds the delay without an onset, and uses that of ``AIC`` to locate the pulse.
    """
    strong = first_strong(x, begin, end, period, noise)
    if strong < 0:
        return np.nan, -1
    if picker == THRESHOLD:
        return threshold(x, begin, strong + 1, noise), strong
    if picker == MATCHED:
        return strong - RISE * period, strong
    # A little beyond the extremum, so that the second part is long enough for a variance.
    end = min(strong + 1 + math.ceil(0.25 * period), end)
    if picker == ENERGY_RATIO:
        return energy_ratio(x, begin, end, period), strong
    if picker == STA_LTA:
        return sta_lta(x, begin, end, period), strong
    return aic(x, begin, end), strong
