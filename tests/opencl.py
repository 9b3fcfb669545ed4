"""Fixture: the OpenCL device of this machine."""

from functools import cache

from bentray_kernels.eikonal import METHODS
from bentray_kernels.opencl import select_device


@cache
def refusal() -> str:
    """Why no device can be used here; empty where one passes its self-test."""
    reason = select_device().reason
    return reason and f"no OpenCL device passes its self-test here: {reason}"


def methods() -> tuple[str, ...]:
    """The Eikonal methods that run here; those on a device only where one passes."""
    return tuple(name for name, method in METHODS.items() if not (method.on_device and refusal()))
