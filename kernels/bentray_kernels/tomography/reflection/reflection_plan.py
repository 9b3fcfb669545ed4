"""Plan of a reflection image, shared by its tasks: medium, elements, used pairs and pixels."""

import math
from dataclasses import dataclass

import numpy as np

from ...acquisition import Dataset
from ...acquisition.array_hull import inside_array
from ...arrays import Flags, Floats, Ints
from ...errors import InvalidInput
from ...wave.emissions import Engine
from ..directivity import within_opening
from ..settings import Settings
from ..solver_choice import echo_engine
from .delay_and_sum import Pixels

# Pixels of a wavelength, and along a side at most, by default. Half the diagonal of a pixel of a quarter of a
# wavelength turns the phase of an echo by 2.2 rad: a point between four of them vanishes.
PIXELS_A_WAVE, SIDE = 8, 2048
# Along a side at most, whatever is requested.
MAX_SIDE = 4096

# Nothing is imaged nearer to the elements than this, wavelengths.
RIM_WAVES = 2.0

# Emissions of a task: as many as have this size as signals.
TASK_BYTES = 128 * 2**20


@dataclass(frozen=True)
class ReflectionPlan:
    """Data of the reflection image of one slice, without traces.

    Attributes:
        speed: (nx, ny), in which delays are computed, m/s.
        spacing: of its nodes, m.
        elements: (k, 2), emitters and receivers, m, node 0 at 0.
        emitters, receivers: (ntx,), (nrx,), their indices in ``elements``.
        used: (ntx, nrx), pairs that are summed.
        pixels: of the image.
        pixel_m, origin_m: distance of pixels and position of the first in the dataset's coordinates, m.
        frequency_hz: centre frequency.
        water_mps: speed of the water, m/s.
        engine: what sums the echoes.
    """

    speed: Floats
    spacing: float
    elements: Floats
    emitters: Ints
    receivers: Ints
    used: Flags
    pixels: Pixels
    pixel_m: float
    origin_m: tuple[float, float]
    frequency_hz: float
    water_mps: float
    engine: Engine = "compiled"

    @property
    def emissions(self) -> Ints:
        """Emissions with a used pair."""
        return np.flatnonzero(self.used.any(axis=1))


def check_reflection(settings: Settings, *, traces: bool, in_space: bool) -> None:
    """Check that a reflection image is possible, if the settings request one.

    Raises:
        InvalidInput: for a scan without traces or centre frequency, or elements in space.
    """
    if not settings.reflection.enabled:
        return
    if not traces:
        accepted = "false: the scan has no traces (waveform/object), or no centre frequency"
        raise InvalidInput("reflection", True, accepted)
    if in_space or settings.decomposition == "volume":
        raise InvalidInput("reflection", True, "false for a volume: it works on slices")


def plan_reflection(
    dataset: Dataset,
    settings: Settings,
    speed: Floats,
    spacing: float,
    origin: tuple[float, float],
) -> ReflectionPlan:
    """The plan of one slice.

    Args:
        dataset: the slice; its traces may still be in their file.
        settings: of the reconstruction.
        speed: (nx, ny), the reconstructed image, m/s.
        spacing: of its nodes, m.
        origin: position of node 0, m.

    Raises:
        InvalidInput: naming what is missing or does not fit.
    """
    if dataset.center_frequency_hz is None:
        raise InvalidInput("acquisition@center_frequency_hz", "nothing", "the centre frequency, Hz")
    members = np.union1d(dataset.tx, dataset.rx)
    elements = dataset.element_position_m[members]
    wavelength = dataset.water_speed_mps / dataset.center_frequency_hz
    low, extent = elements.min(axis=0), np.ptp(elements, axis=0)
    pixel = pixel_size(settings.numerics.pixel_m, float(extent.max()), wavelength)
    shape = tuple(int(n) for n in np.floor(extent / pixel + 1e-9) + 1)
    first = low + 0.5 * (extent - pixel * (np.array(shape) - 1))
    inside = inside_array(elements, shape, pixel, first, RIM_WAVES * wavelength / pixel)
    if not inside.any():
        raise InvalidInput("pixel_m", pixel, "several pixels inside the array")
    used = dataset.tx[:, None] != dataset.rx[None, :]
    if dataset.valid is not None:
        used = used & dataset.valid
    if settings.opening_angle_deg is not None:
        used = used & within_opening(dataset, settings.opening_angle_deg)
    return ReflectionPlan(
        speed=np.full_like(speed, dataset.water_speed_mps) if settings.numerics.delays == "water" else speed,
        spacing=spacing,
        elements=elements - np.asarray(origin),
        emitters=np.searchsorted(members, dataset.tx),
        receivers=np.searchsorted(members, dataset.rx),
        used=used,
        pixels=Pixels((first - np.asarray(origin)) / spacing, pixel / spacing, inside),
        pixel_m=pixel,
        origin_m=(float(first[0]), float(first[1])),
        frequency_hz=dataset.center_frequency_hz,
        water_mps=dataset.water_speed_mps,
        engine=echo_engine(settings),
    )


def pixel_size(requested_m: float | None, extent_m: float, wavelength_m: float) -> float:
    """Pixel spacing, m: as requested, or an eighth of the wavelength, or so that there are ``SIDE``.

    Raises:
        InvalidInput: for a requested distance above the wavelength, or that gives more than ``MAX_SIDE``.
    """
    if requested_m is None:
        return max(wavelength_m / PIXELS_A_WAVE, extent_m / (SIDE - 1))
    least = extent_m / (MAX_SIDE - 1)
    if not least <= requested_m <= wavelength_m:
        accepted = f"from {least:.3g} m ({MAX_SIDE} pixels a side) to the wavelength, {wavelength_m:.3g} m"
        raise InvalidInput("pixel_m", requested_m, accepted)
    return requested_m


def emissions_per_task(receivers: int, samples: int) -> int:
    """Emissions whose signals, of so many samples each, a task holds."""
    return max(1, min(32, TASK_BYTES // max(1, 8 * receivers * samples)))


def side_pixels(extent_m: float, pixel_m: float) -> int:
    """Pixels along a side."""
    return math.floor(extent_m / pixel_m + 1e-9) + 1
