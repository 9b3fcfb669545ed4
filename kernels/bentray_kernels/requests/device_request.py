"""Where a user wants engines to compute, as every interface calls it; free of compiled code and OpenCL."""

from __future__ import annotations

from typing import Literal, get_args

DeviceRequest = Literal["auto", "cpu", "opencl"]
REQUESTS: tuple[str, ...] = get_args(DeviceRequest)

DESCRIPTION = (
    "Where to compute what exists for OpenCL devices too. auto: on the device where a benchmark on this "
    "machine was faster; cpu: never on a device; opencl: on the device, an error without one."
)
