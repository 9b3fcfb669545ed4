"""Requirements of settings on a scan that its header shows: checked first, without compiled code."""

from ..acquisition.array_hull import check_extent
from ..acquisition.dataset import Dataset
from ..errors import InvalidInput
from . import pairs
from .decomposition import decomposition_of
from .directivity import check_normals
from .settings import Settings


def check_scan(dataset: Dataset, settings: Settings, samples: int) -> None:
    """Check that a scan has what the settings require, as far as its header shows.

    Args:
        dataset: without its traces, which may be in its file.
        settings: as requested.
        samples: of each trace of the object; 0 without traces.

    Raises:
        InvalidInput: naming the setting or the field of the file.
    """
    water = dataset.in_water_of(settings.water_temperature_c).water_speed_mps
    check_bounds(settings, water)
    if settings.roi and dataset.roi is None:
        raise InvalidInput("mask/roi", "nothing", "a region of interest, since the setting roi is true")
    if settings.reads_amplitudes and not samples:
        raise InvalidInput("waveform/object", "no traces", "traces to read amplitudes from")
    if settings.method == "waveform":
        check_waveform(settings, samples, dataset.slices, in_space=dataset.element_position_m.shape[1] != 2)
    check_normals(settings.opening_angle_deg, normals=dataset.element_normal is not None)
    pairs.count(dataset, settings)
    flat = decomposition_of(dataset.element_position_m, settings) == "slices"
    check_extent(dataset.element_position_m[:, :2] if flat else dataset.element_position_m)


def check_bounds(settings: Settings, water_mps: float) -> None:
    """Check that the speed of the water lies within the bounds of the speed.

    Raises:
        InvalidInput: for bounds that exclude it.
    """
    low, high = settings.speed_bounds_mps
    if not low <= water_mps <= high:
        accepted = f"bounds around the speed of the water, {water_mps:g} m/s"
        raise InvalidInput("speed_bounds_mps", (low, high), accepted)


def check_waveform(settings: Settings, samples: int, slices: int, *, in_space: bool) -> None:
    """Check that a scan can be refined by full-waveform inversion.

    Args:
        settings: as requested.
        samples: of each trace of the object; 0 without traces.
        slices: of the scan.
        in_space: whether the elements have 3-D positions.

    Raises:
        InvalidInput: without traces, with elements in space, or with a region of interest of several slices.
    """
    if not samples:
        raise InvalidInput(
            "method",
            "'waveform' for a scan without traces",
            "sart, gauss-newton or auto, or waveform/object in the file",
        )
    if in_space:
        raise InvalidInput(
            "method", "'waveform' for elements in space", "sart, gauss-newton or auto, or slices of a ring"
        )
    if settings.roi and slices > 1:
        raise InvalidInput("roi", "true", "false, with method waveform and several slices")
