"""Limits on the size of scans and on their physical quantities, in one table; wider than every known scanner.

The largest ultrasound tomographs have 2,304 elements that move to ten places (23,040 positions, 5.3e8
pairs), or rings of 2,048 elements at some 60 heights (2.5e8 pairs), and record some 4,000 samples a trace.
"""

import math
from collections.abc import Sequence

from ..errors import InvalidInput
from .ranges import Range

# Share of the pairs of a scan that its examination may leave out, by default and as a setting.
MAX_LEFT_OUT, LEFT_OUT = 0.334, Range(0.0, 1.0)

# Counts. Pairs are of all slices together.
ELEMENTS = Range(3, 65_536)
EMISSIONS = RECEIVERS = Range(1, 65_536)
SLICES = Range(1, 4_096)
PAIRS = Range(1, 2**29)
SAMPLES = Range(1, 2**20)
# Of a region of interest, and of the truth of a phantom.
NODES = Range(1, 2**30)

# Of a coupling medium, and of what is in it: gases are slower than any, no solid is faster.
SPEED_MPS = Range(200.0, 10_000.0, unit="m/s")
TRUE_SPEED_MPS = Range(1.0, 50_000.0, unit="m/s")
# From one end of the array to the other, and of a ring's radius.
WIDTH_M = Range(2e-3, 4.0, unit="m")
RADIUS_M = Range(1e-3, 2.0, unit="m")
# Of any place, from the origin.
PLACE_M = Range(-100.0, 100.0, unit="m")
SPACING_M = Range(1e-9, 1e3, unit="m")
# 4 m at 300 m/s take 0.013 s.
TIME_S = Range(-0.1, 0.1, unit="s")
DEVIATION_S = Range(0.0, 0.1, above=True, unit="s")
SAMPLING_HZ = Range(1e3, 1e11, unit="Hz")
FREQUENCY_HZ = Range(1e3, 1e10, unit="Hz")
ATTENUATION_NP_M = Range(0.0, 1e6, unit="Np/m")
LOG_RATIO_NP = Range(-1e3, 1e3, unit="Np")
TEMPERATURE_C = Range(-50.0, 150.0, unit="°C")
# Of water whose speed follows from it, see ``acquisition.water``.
WATER_C = Range(0.0, 95.0, unit="°C")
# Of pressures in any unit: their squares and sums stay numbers.
PRESSURE = Range(-1e30, 1e30)
SCALE = Range(1e-30, 1e30)

# What is counted along the axes of an array of a scan, from the last axis on; (name, range).
Counts = tuple[tuple[str, Range], ...]
_ELEMENTS: Counts = (("coordinates", Range(2, 3)), ("elements", ELEMENTS))
COUNTED: dict[str, Counts] = {
    "geometry/element_position_m": _ELEMENTS,
    "geometry/element_normal": _ELEMENTS,
    "acquisition/tx": (("emissions", EMISSIONS),),
    "acquisition/rx": (("receivers", RECEIVERS),),
    "acquisition/wavelet": (("samples", SAMPLES),),
    "slice/z_m": (("slices", SLICES),),
    "waveform/object": (("samples", SAMPLES),),
    "waveform/water": (("samples", SAMPLES),),
}
# Of arrays over pairs, and over nodes, the product of all axes (of traces, of all but the last) is bounded.
OVER_PAIRS = (
    *(f"traveltime/{name}" for name in ("tof_s", "delta_tof_s", "sigma_s")),
    "amplitude/log_ratio_np",
    "mask/valid",
    *(f"waveform/{name}" for name in ("object", "water", "object_scale", "water_scale")),
)
OVER_NODES = ("mask/roi", "truth/sound_speed_mps", "truth/attenuation_np_m")


def check_size(path: str, shape: Sequence[int], shown: str = "") -> None:
    """Refuse an array of a scan that is larger than any scan has, from its shape alone.

    Args:
        path: of the array in the upload format, as ``acquisition/tx``.
        shape: as the file declares it; whether it has the right axes is for others to check.
        shown: the name that it has in this file, if that is another.

    Raises:
        InvalidInput: naming the array, the number and the limit.
    """
    counts = [*COUNTED.get(path, ())]
    if len(counts) == 1 and path not in OVER_PAIRS:
        # A list may come as a row or a column.
        shape = (math.prod(shape),)
    for (what, within), count in zip(counts, reversed(shape), strict=False):
        if count > within.most:
            raise InvalidInput(shown or path, f"{count} {what}", f"at most {within.most} {what}")
    for paths, what, within in ((OVER_PAIRS, "pairs", PAIRS), (OVER_NODES, "nodes", NODES)):
        # Traces have their samples beside.
        count = math.prod(shape[: len(shape) - len(counts)])
        if path in paths and count > within.most:
            raise InvalidInput(shown or path, f"{count} {what}", f"at most {within.most} {what}")


def check_speeds(name: str, pair: tuple[float, float]) -> None:
    """Refuse a lowest and a highest speed, m/s, that are no range of speeds.

    Raises:
        InvalidInput: naming ``name``.
    """
    slowest, fastest = SPEED_MPS.least, SPEED_MPS.most
    if len(pair) != 2 or not slowest <= pair[0] < pair[1] <= fastest:
        accepted = f"(lowest, highest) in m/s, {slowest:g} <= lowest < highest <= {fastest:g}"
        raise InvalidInput(name, tuple(pair), accepted)
