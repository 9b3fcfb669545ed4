"""Whether a reconstruction with ``device: auto`` computes on an OpenCL device, decided before it begins."""

import math
from typing import NamedTuple

from ..opencl.engine_selection import Work, check_available, may_select_device, requested, select_engine
from .sart.device_slices import MEMORY_SHARE, TRIAL_EMITTERS, SliceSize
from .settings import Settings
from .solver_choice import sart_engine

# Emitters of full waveforms that are in flight together, at the least.
WAVE_EMITTERS = 8

# Pixels of a reflection image along a node, about.
PIXELS_OF_A_NODE = 4


class ScanSize(NamedTuple):
    """Numbers of a scan.

    Attributes:
        slices: their number.
        emitters, receivers: of a slice.
        samples: of a trace; 0: no traces.
    """

    slices: int
    emitters: int
    receivers: int
    samples: int


def needs_decision(settings: Settings) -> bool:
    """Whether the device depends on the scan and on this machine; cheap where there is none."""
    if settings.device == "cpu" or (settings.method == "gauss-newton" and not settings.reflection.enabled):
        return False
    return settings.device == "opencl" or may_select_device()


def device_work(scan: ScanSize, settings: Settings) -> Work | None:
    """The part of a reconstruction that exists for devices; None if nothing of it does.

    Full waveforms take nearly all of the time where there are any, then a reflection image, else slices by
    SART, also those of the candidates of ``auto``.

    Args:
        scan: to reconstruct.
        settings: with ``nodes`` and ``decomposition``.
    """
    nodes = settings.grid_nodes
    waves = settings.method == "waveform" or (settings.method == "auto" and bool(settings.minutes))
    if waves and scan.samples:
        # There and back, at about one step a sample.
        return Work("wave", 2.0 * WAVE_EMITTERS * scan.samples * nodes**2)
    if settings.reflection.enabled and scan.samples:
        pixels = (PIXELS_OF_A_NODE * nodes) ** 2
        return Work("reflection", float(scan.emitters * scan.receivers * pixels))
    tried = settings.changed(device="opencl")
    if settings.method == "auto":
        tried = tried.changed(method="sart")
    if sart_engine(tried, 3 if settings.decomposition == "volume" else 2) != "opencl":
        return None
    size = SliceSize((nodes, nodes), scan.emitters, scan.receivers, 1, settings.numerics.subset)
    return Work(
        "sart",
        float(TRIAL_EMITTERS * scan.slices * nodes**2),
        math.ceil(size.bytes / MEMORY_SHARE),
        size.largest_bytes,
    )


def choose_device(scan: ScanSize, settings: Settings) -> tuple[str, str]:
    """The device of a reconstruction on this machine, ``opencl`` where ``auto`` means it here, and why.

    The reason is empty where nothing had to be decided.

    Args:
        scan, settings: as ``device_work``.

    Raises:
        InvalidInput: for a device that is requested, and of which there is none.
    """
    if not needs_decision(settings) or (work := device_work(scan, settings)) is None:
        return settings.device, ""
    if settings.device == "opencl":
        check_available("opencl")
        return settings.device, ""
    session = select_engine(work)
    # Compiled tasks take all cores of a processor; the benchmark measured one core beside all of the driver.
    if session is None or (session.device.kind == "cpu" and requested() == "auto"):
        return settings.device, "no OpenCL device of this machine was faster in a trial"
    return "opencl", f"{session.device.name} was faster in a trial"
