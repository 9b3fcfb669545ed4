"""Speed of sound in pure water from its temperature, and back."""

import math

import numpy as np

from ..errors import InvalidInput
from ..requests.limits import WATER_C

# W. Marczak, "Water as a standard in the measurements of speed of sound in liquids",
# J. Acoust. Soc. Am. 102 (1997) 2776-2779, table II: powers 0 to 5 of the temperature in °C.
MARCZAK = (1.402385e3, 5.038813, -5.799136e-2, 3.287156e-4, -1.398845e-6, 2.787860e-9)

# The fit is valid from 0 to 95 °C; the speed rises up to 74.1 °C and falls above.
RANGE_C = (WATER_C.least, WATER_C.most)
FASTEST_C = 74.0

# Errors that are not faults: of a thermometer, °C, and of the size of an array, as a part.
THERMOMETER_C, APERTURE = 1.0, 0.002

# Change of the speed with the temperature, m/s per degree, of other media than pure water.
USUAL_MPS_PER_DEGREE = 3.0


def speed_from_temperature(temperature_c: float) -> float:
    """Speed of sound in water, m/s, by Marczak (1997) at atmospheric pressure.

    Raises:
        InvalidInput: for a temperature outside 0 to 95 °C.
    """
    low, high = RANGE_C
    if not low <= temperature_c <= high:
        raise InvalidInput("water@temperature_c", temperature_c, f"a temperature from {low:g} to {high:g} °C")
    return float(np.polyval(MARCZAK[::-1], temperature_c))


def temperature_from_speed(speed_mps: float) -> float:
    """Temperature of water, °C, for a speed of sound; the solution below 74 °C, which is unique.

    Raises:
        InvalidInput: for a speed that water does not have between 0 and 74 °C.
    """
    low, high = RANGE_C[0], FASTEST_C
    slowest, fastest = speed_from_temperature(low), speed_from_temperature(high)
    if not slowest <= speed_mps <= fastest:
        raise InvalidInput(
            "water@sound_speed_mps", speed_mps, f"a speed from {slowest:.1f} to {fastest:.1f} m/s"
        )
    # Bisection converges to the last bit: the speed rises strictly on this interval.
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high) or math.isclose(low, high, rel_tol=0.0, abs_tol=1e-12):
            return middle
        if speed_from_temperature(middle) < speed_mps:
            low = middle
        else:
            high = middle


def stated_deviation(speed_mps: float, temperature_c: float | None) -> float:
    """Usual error of a stated speed, m/s, from those of a thermometer and of the size of the array."""
    degree = USUAL_MPS_PER_DEGREE
    low, high = RANGE_C
    if temperature_c is not None and low + 0.5 <= temperature_c <= high - 0.5:
        degree = abs(
            speed_from_temperature(temperature_c + 0.5) - speed_from_temperature(temperature_c - 0.5)
        )
    return math.hypot(THERMOMETER_C * degree, APERTURE * speed_mps)


def describe_assumption(temperature_c: float) -> str:
    """A sentence for results of scans without a stated water, with the effect of one degree."""
    speed = speed_from_temperature(temperature_c)
    slope = speed_from_temperature(temperature_c + 1.0) - speed
    return (
        f"The water temperature is not stated in the scan: {temperature_c:g} °C ({speed:.1f} m/s) is "
        f"assumed; one degree more raises every speed by {slope:.0f} m/s. State it by the setting "
        "water_temperature_c (--water-temperature), or on the page of the scan."
    )
