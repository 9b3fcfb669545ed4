"""Table of the limits of scan files."""

from bentray_kernels.requests import limits
from bentray_kernels.requests.ranges import Range

from .tables import table

MEANING = {
    "LEFT_OUT": "share of the pairs that an examination may leave out",
    "ELEMENTS": "elements",
    "EMISSIONS": "emissions of a slice",
    "RECEIVERS": "receivers of an emission",
    "SLICES": "slices",
    "PAIRS": "pairs of emission and receiver, in all slices",
    "SAMPLES": "samples of a trace",
    "NODES": "nodes of a region of interest or of the truth",
    "SPEED_MPS": "speed of the coupling medium",
    "TRUE_SPEED_MPS": "speed in the truth of a phantom",
    "WIDTH_M": "width of the array",
    "RADIUS_M": "radius of a ring",
    "PLACE_M": "coordinate of an element",
    "SPACING_M": "node spacing",
    "TIME_S": "travel time, or difference of travel times",
    "DEVIATION_S": "standard deviation of a travel time",
    "SAMPLING_HZ": "sampling rate",
    "FREQUENCY_HZ": "centre frequency",
    "ATTENUATION_NP_M": "attenuation",
    "LOG_RATIO_NP": "logarithm of an amplitude ratio",
    "TEMPERATURE_C": "temperature of the water",
    "WATER_C": "the same where the speed of sound follows from it",
    "SCALE": "absolute scale of the traces",
    "PRESSURE": "sample of a trace times its scale",
}


def scan_limits() -> str:
    """Quantity and accepted range, for every ``Range`` of ``bentray_kernels.requests.limits``."""
    found = {name: value for name, value in vars(limits).items() if isinstance(value, Range)}
    rows = [(MEANING[name], within.words.removeprefix("a number ")) for name, within in found.items()]
    return table(("what", "accepted"), rows)
