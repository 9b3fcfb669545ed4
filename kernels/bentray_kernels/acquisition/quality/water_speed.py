"""Water speed fitted to arrival times over distance, compared with the stated one."""

from ...errors import InvalidInput
from ..dataset import Dataset
from ..reference.water_chords import FASTEST_MPS, SLOWEST_MPS
from ..water import describe_assumption, speed_from_temperature, stated_deviation, temperature_from_speed
from .finding import Action, Finding

WATER_SPEED = "water speed"

# Standard deviations of the fit within which it agrees.
AGREEING = 3.0

# Error of an assumed speed, m/s: 5 °C.
ASSUMED_MPS = 15.0

# Largest difference at which a speed and a temperature of the file mean the same, m/s.
SAME_MPS = 0.5


def find_water_speed(dataset: Dataset, speed_mps: float, sigma_mps: float) -> list[Finding]:
    """Compare the stated water speed with a fit; an assumed speed is replaced by the fit.

    A stated speed is kept: the size of the array may be wrong instead. The difference is a finding if
    neither a thermometer nor the size of the array explains it.

    Args:
        dataset: of one slice.
        speed_mps: fitted to travel times of chords through water.
        sigma_mps: its standard deviation.
    """
    if dataset.water_temperature_assumed:
        # A fit that is worse than the assumption does not replace it.
        if not AGREEING * sigma_mps <= ASSUMED_MPS:
            return []
        action: Action = "corrected"
        accepted = "the temperature of the water in the file"
        if not SLOWEST_MPS <= speed_mps <= FASTEST_MPS:
            action = "refused"
            accepted = (
                f"{SLOWEST_MPS:g} to {FASTEST_MPS:g} m/s for water that the scan does not state; check the "
                "positions of the elements and their order, or state the speed of the medium"
            )
    else:
        allowed = (
            stated_deviation(dataset.water_speed_mps, dataset.water_temperature_c) + AGREEING * sigma_mps
        )
        if abs(speed_mps - dataset.water_speed_mps) <= allowed:
            return []
        action = "reported"
        accepted = (
            f"within {allowed:.1f} m/s; state it by --sound-speed {speed_mps:.1f} if the array is right"
        )
    message = f"{stated_water(dataset)}; the travel times say {fitted_water(speed_mps, sigma_mps)}"
    if action == "reported":
        message = f"water temperature contradicts the travel times: {message}"
    return [Finding(WATER_SPEED, message, accepted, action, value=speed_mps, unit="m/s")]


def water_summary(dataset: Dataset, speed_mps: float, sigma_mps: float) -> str:
    """The water speed that is used, and how far a fit and the statement differ, in one line.

    Args:
        dataset: as in the file.
        speed_mps: fitted to travel times of chords through water.
        sigma_mps: its standard deviation.
    """
    fitted = fitted_water(speed_mps, sigma_mps)
    off = abs(speed_mps - dataset.water_speed_mps)
    more = f"{off:.1f} m/s {'more' if speed_mps > dataset.water_speed_mps else 'less'}"
    if not dataset.water_temperature_assumed:
        used = _with_temperature(dataset.water_speed_mps)
        return f"Water of {used}, as stated; chords that miss the object say {fitted}, {more}."
    if find_water_speed(dataset, speed_mps, sigma_mps):
        return (
            f"Water of {fitted}, by chords that miss the object; its temperature is not stated in the scan."
        )
    assumed = "" if dataset.water_temperature_c is None else describe_assumption(dataset.water_temperature_c)
    return f"{assumed} Chords that miss the object say {fitted}, {more}."


def replaced_water(recorded: Dataset, used: Dataset) -> str:
    """The water that a setting states in place of that of the scan, in one line.

    Args:
        recorded: as in the file.
        used: in the water of the setting.
    """
    return (
        f"Water of {used.water_speed_mps:.1f} m/s ({used.water_temperature_c:.1f} °C), by the setting "
        f"water_temperature_c. In the scan: {stated_water(recorded)}."
    )


def stated_water(dataset: Dataset) -> str:
    """The water as stated or assumed: temperature, if known, and speed."""
    speed, celsius = dataset.water_speed_mps, dataset.water_temperature_c
    if dataset.water_temperature_assumed and celsius is not None:
        return f"water of {celsius:.1f} °C is assumed, {speed:.1f} m/s"
    if celsius is None:
        return f"{speed:.1f} m/s given"
    try:
        meant = speed_from_temperature(celsius)
    except InvalidInput:
        return f"{speed:.1f} m/s given"
    if abs(meant - speed) <= SAME_MPS:
        return f"{celsius:.1f} °C means {speed:.1f} m/s"
    return f"{speed:.1f} m/s given ({celsius:.1f} °C means {meant:.1f} m/s)"


def fitted_water(speed_mps: float, sigma_mps: float) -> str:
    """A fitted speed with its standard deviation, and the temperature of pure water with it."""
    return _with_temperature(speed_mps, f"{speed_mps:.1f} ± {max(sigma_mps, 0.1):.1f} m/s")


def _with_temperature(speed_mps: float, text: str = "") -> str:
    """A speed with the temperature of pure water that has it, if any."""
    text = text or f"{speed_mps:.1f} m/s"
    try:
        return f"{text} ({temperature_from_speed(speed_mps):.1f} °C)"
    except InvalidInput:
        return text
