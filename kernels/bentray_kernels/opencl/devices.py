"""The OpenCL devices of this machine, and their selection by the user."""

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from ..errors import InvalidInput
from .library import library_of, package_of
from .platforms import platforms
from .pocl import prepare

# The environment variable that selects the device, and its value for none.
WISH = "BENTRAY_OPENCL_DEVICE"
NONE = "none"

# The environment variable that decides for this machine whether devices compute, see ``engine_selection``,
# and its value for never.
VARIABLE = "BENTRAY_DEVICE"
NEVER = "cpu"


@dataclass(frozen=True)
class Device:
    """An OpenCL device as described by its driver; plain values, so that it can be stored and sent.

    Attributes:
        index: its position among all devices of all platforms.
        platform: name of the platform.
        name: name of the device.
        kind: ``gpu``, ``accelerator``, ``cpu`` or ``other``.
        version: the reported OpenCL version; PoCL adds the processor that it compiles for.
        driver: version of the driver.
        double_precision: whether it computes in float64.
        library: path of the driver's shared library; empty if unknown.
        package: name and version of the Python package that contains it; empty for one of the system.
        memory_bytes, buffer_bytes: of its memory, and of the largest buffer in it; 0: unknown.
    """

    index: int
    platform: str
    name: str
    kind: str
    version: str
    driver: str
    double_precision: bool
    library: str = ""
    package: str = ""
    # A driver may count memory that is free now.
    memory_bytes: int = field(default=0, compare=False, repr=False)
    buffer_bytes: int = field(default=0, compare=False, repr=False)

    @property
    def label(self) -> str:
        return f"{self.platform}:{self.name}"


def find_devices() -> tuple[Device, ...]:
    """Every OpenCL device, in the order of the platforms.

    Empty where OpenCL is not installed, and where the environment hides every device.
    """
    return tuple(_described(index, handle) for index, handle in enumerate(_handles()))


def handle_of(device: Device) -> Any:
    """The ``pyopencl.Device`` of a device.

    Raises:
        LookupError: if the devices of the machine have changed.
    """
    handles = _handles()
    if device.index < len(handles) and _described(device.index, handles[device.index]) == device:
        return handles[device.index]
    raise LookupError(f"{device.label} is no longer OpenCL device {device.index}")


def hidden() -> str:
    """The variable that hides every device, with its value; empty if none does."""
    for name, value in ((WISH, NONE), (VARIABLE, NEVER)):
        if os.environ.get(name, "").strip().lower() == value:
            return f"{name}={value}"
    return ""


def select_devices(devices: Sequence[Device], selection: str | None) -> tuple[Device, ...]:
    """The devices to test, in order: the one selected, else GPUs first and processors last.

    Of several drivers for one processor Intel's comes first (measured, see docs/how-to/use-opencl.md).

    Args:
        devices: available devices.
        selection: an index, a part of ``platform:device`` in any case, or ``none``; None or empty: no
            selection.

    Raises:
        InvalidInput: when it matches no device or more than one; lists the available ones.
    """
    if not selection:
        return tuple(sorted(devices, key=_rank))
    word = selection.strip().lower()
    if word == NONE:
        return ()
    # A number that is not an index may be part of a name: "3090".
    fitting = [device for device in devices if str(device.index) == word]
    fitting = fitting or [device for device in devices if word in device.label.lower()]
    if len(fitting) != 1:
        listed = "; ".join(f"{device.index} = {device.label}" for device in devices) or "there is none here"
        value = f"{selection!r}, which fits {len(fitting)} devices"
        raise InvalidInput(WISH, value, f"an index or a part of the name of one OpenCL device: {listed}")
    return tuple(fitting)


def _rank(device: Device) -> tuple[int, bool]:
    kinds = {"gpu": 0, "accelerator": 1, "cpu": 2}
    return kinds.get(device.kind, 3), not device.platform.startswith("Intel")


def _handles() -> list[Any]:
    if hidden():
        return []
    try:
        import pyopencl as cl
    except ImportError:  # no OpenCL loader on this machine
        return []
    # "No platform" is an error in OpenCL, as is a platform without devices.
    try:
        available = platforms()
    except cl.Error:
        return []
    handles: list[Any] = []
    for platform in available:
        with suppress(cl.Error):
            handles += platform.get_devices()
    for handle in handles:
        prepare(handle)
    return handles


def _described(index: int, handle: Any) -> Device:
    import pyopencl as cl

    library = library_of(handle)
    kinds = {"gpu": cl.device_type.GPU, "accelerator": cl.device_type.ACCELERATOR, "cpu": cl.device_type.CPU}
    return Device(
        index,
        handle.platform.name.strip(),
        handle.name.strip(),
        next((kind for kind, bit in kinds.items() if handle.type & bit), "other"),
        handle.version.strip(),
        handle.driver_version.strip(),
        bool(handle.double_fp_config) if "cl_khr_fp64" in handle.extensions else False,
        library,
        package_of(library),
        int(handle.global_mem_size),
        int(handle.max_mem_alloc_size),
    )
