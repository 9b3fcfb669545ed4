"""Plausibility of a scan: width of the array, travel times against distances, and the order of elements."""

import numpy as np

from ..arrays import Flags, Floats
from ..errors import InvalidInput
from ..requests.limits import DEVIATION_S, LOG_RATIO_NP, PLACE_M, PRESSURE, RADIUS_M, TIME_S, WIDTH_M
from . import rules
from .arrangement import FASTEST_MPS, SLOWEST_MPS, Arrangement, Mismatch, find_mismatch
from .dataset import POSITION, Dataset
from .impossible_times import impossible_words, lost_pairs

# Apparent sound speed of most pairs: fat has 1,400 m/s, bone 4,000.
BULK_MPS = (SLOWEST_MPS, FASTEST_MPS)

# A scan is plausible if at least this fraction of its pairs is: single picks may be arbitrarily wrong.
MIN_PLAUSIBLE = 2.0 / 3.0

# Differences look like arrival times if at least this fraction of them does.
MIN_ARRIVALS = 0.5

# Differences within this fraction of the whole time through water are arrival times: as differences, they
# would mean an object with less than 0.6 of the speed of the water.
ARRIVALS = 0.3

# Pairs nearer than this fraction of the array's width are ignored: picks of neighbours are often wrong.
NEAR = 0.1

# Slices, emitters and receivers that are sampled, evenly spaced.
SAMPLED = (8, 128, 512)

# Typical array width, m, which decides between several possible units.
USUAL_M = 0.2

LENGTHS = {"cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9, "km": 1e3}
TIMES = {"ms": 1e-3, "µs": 1e-6, "ns": 1e-9}


class ImplausibleUnit(InvalidInput):
    """Lengths or times that are wrong in SI units.

    Attributes:
        plain: what is accepted, without the likely unit.
        unit: the likely unit; empty where none is.
    """

    def __init__(self, field: str, value: object, plain: str, hint: str = "", unit: str = "") -> None:
        self.plain, self.unit = plain, unit
        super().__init__(field, value, f"{plain}{hint}")


class WrongArrangement(InvalidInput):
    """Travel times that do not belong to the stated positions of their elements.

    Attributes:
        plain: what is accepted, without the proposal.
        proposal: the arrangement that explains the times; None where no single one does.
    """

    def __init__(self, field: str, mismatch: Mismatch) -> None:
        self.proposal: Arrangement | None = mismatch.proposal
        self.plain = "times in the order of the elements in tx and rx, and positions of these elements in m"
        hint = "" if self.proposal is None else f"; it looks like {self.proposal.words}"
        super().__init__(field, f"times that do not fit the positions: {mismatch.found}", self.plain + hint)


def check_plausible(dataset: Dataset) -> None:
    """Reject a scan whose lengths or times are in another unit, impossible, or those of other elements.

    Traces are not read: they may remain in the file.

    Raises:
        InvalidInput: naming the field and its value; ``ImplausibleUnit`` with the unit that is likely;
            ``WrongArrangement`` with the arrangement that explains the times.
    """
    _check_positions(dataset)
    for path, times in (
        ("traveltime/tof_s", dataset.tof_s),
        ("traveltime/delta_tof_s", dataset.delta_tof_s),
    ):
        if times is not None:
            _check_times(dataset, path, times)
            rules.within_or_nan(path, times, TIME_S)
    for path, values, within in (
        ("traveltime/sigma_s", dataset.sigma_s, DEVIATION_S),
        ("amplitude/log_ratio_np", dataset.log_ratio_np, LOG_RATIO_NP),
        ("geometry/element_normal", dataset.element_normal, PRESSURE),
        ("acquisition/wavelet", dataset.wavelet, PRESSURE),
    ):
        if values is not None:
            rules.within_or_nan(path, values, within)
    _check_missing(dataset)
    if dataset.picked:
        check_arrangement(dataset)


def check_arrangement(dataset: Dataset) -> None:
    """Reject travel times that belong to other elements than the scan says, see ``find_mismatch``.

    Args:
        dataset: with travel times; of several slices the one with the most of them is compared.

    Raises:
        WrongArrangement: naming the travel times.
    """
    absolute = dataset.tof_s is not None
    times = dataset.tof_s if absolute else dataset.delta_tof_s
    assert times is not None
    counts = [int(np.isfinite(plane).sum()) for plane in (times if times.ndim == 3 else times[None])]
    mismatch = find_mismatch(dataset.slice(int(np.argmax(counts))))
    if mismatch is not None:
        raise WrongArrangement("traveltime/tof_s" if absolute else "traveltime/delta_tof_s", mismatch)


def _check_missing(dataset: Dataset) -> None:
    """Reject a scan of which most times were impossible."""
    lost = lost_pairs(dataset.impossible_times)
    times = dataset.tof_s if dataset.tof_s is not None else dataset.delta_tof_s
    if times is None or not lost:
        return
    other = (dataset.tx[:, None] != dataset.rx[None, :]) & np.isfinite(times)
    left = int(other.sum())
    if left < lost:
        path = "traveltime/tof_s" if dataset.tof_s is not None else "traveltime/delta_tof_s"
        shortage = f"impossible times ({impossible_words(dataset.impossible_times)}) and only {left} others"
        raise InvalidInput(path, shortage, "arrival times of most pairs, NaN for missing ones")


def _check_positions(dataset: Dataset) -> None:
    position = dataset.element_position_m
    # Halved, so that the difference of the largest numbers is finite.
    width = 2.0 * float(np.ptp(0.5 * position, axis=0).max())
    if not WIDTH_M.holds(width):
        width_words = f"an array {width:.4g} m wide"
        raise ImplausibleUnit(POSITION, width_words, WIDTH_M.words, *_length_hint(width, "positions"))
    rules.within_or_nan(POSITION, position, PLACE_M)
    if dataset.radius_m is not None and not RADIUS_M.holds(dataset.radius_m):
        width_words, hint = f"{dataset.radius_m:.4g}", _length_hint(2.0 * dataset.radius_m, "radius")
        raise ImplausibleUnit("geometry@radius_m", width_words, RADIUS_M.words, *hint)
    if dataset.slice_z_m is not None:
        height = 2.0 * float(np.ptp(0.5 * dataset.slice_z_m))
        if height > WIDTH_M.most:
            width_words, hint = f"slices over {height:.4g} m", _length_hint(height, "heights")
            raise ImplausibleUnit("slice/z_m", width_words, f"at most {WIDTH_M.most:g} m", *hint)
        rules.within_or_nan("slice/z_m", dataset.slice_z_m, PLACE_M)


def _length_hint(width: float, what: str) -> tuple[str, str]:
    """A hint at the unit in which a width would be nearest to the typical one, and that unit."""
    widths = {unit: width * factor for unit, factor in LENGTHS.items() if WIDTH_M.holds(width * factor)}
    if not widths:
        return "", ""
    unit = min(widths, key=lambda name: abs(np.log(widths[name] / USUAL_M)))
    verb = "looks" if what == "radius" else "look"
    this = "this" if what == "radius" else "these"
    return f"; {this} {what} {verb} like {unit}: write m", unit


def _check_times(dataset: Dataset, path: str, times: Floats) -> None:
    """Compare times with the distances of their pairs."""
    distance, time = _sample_pairs(dataset, times)
    in_water = distance / dataset.water_speed_mps
    if not distance.size:
        return
    offset = in_water if path == "traveltime/delta_tof_s" else np.zeros_like(in_water)

    def plausible(factor: float) -> bool:
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            speed = distance / (offset + factor * time)
        return bool(np.mean((speed >= BULK_MPS[0]) & (speed <= BULK_MPS[1])) >= MIN_PLAUSIBLE)

    middle = np.argsort(time)[time.size // 2]
    value = f"{time[middle]:.4g} s between elements {distance[middle]:.3g} m apart, the median of all pairs"
    if offset is in_water and np.mean(np.abs(time - in_water) <= ARRIVALS * in_water) >= MIN_ARRIVALS:
        accepted = "arrival with the object minus arrival in water; these look like arrivals: write them to "
        raise InvalidInput(path, value, f"{accepted}traveltime/tof_s")
    if plausible(1.0):
        return
    low, high = BULK_MPS
    unit = next((unit for unit in TIMES if plausible(TIMES[unit])), "")
    hint = f"; these times look like {unit}: write s" if unit else ""
    plain = f"times in s of sound that runs at {low:g} to {high:g} m/s between them"
    raise ImplausibleUnit(path, value, plain, hint, unit)


def _sample_pairs(dataset: Dataset, times: Floats) -> tuple[Floats, Floats]:
    """Distances, m, and times, s, of sampled pairs that have a time."""
    stacked = times if times.ndim == 3 else times[None]
    z, e, r = (
        # At most so many indices, evenly spaced.
        np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.intp))
        for count, most in zip(stacked.shape, SAMPLED, strict=True)
    )
    position = dataset.element_position_m
    offset = position[dataset.tx[e]][:, None, :] - position[dataset.rx[r]][None, :, :]
    distance = np.broadcast_to(np.linalg.norm(offset, axis=-1), (len(z), len(e), len(r)))
    sampled = stacked[np.ix_(z, e, r)]
    # A difference of 0, beside the object, is one in every unit.
    usable: Flags = (
        np.isfinite(sampled)
        & ((sampled != 0.0) | (times is dataset.tof_s))
        & (distance > NEAR * distance.max(initial=0.0))
    )
    if dataset.valid is not None:
        valid = dataset.valid if dataset.valid.ndim == 3 else dataset.valid[None]
        usable &= valid[np.ix_(z, e, r)]
    return distance[usable], sampled[usable]
