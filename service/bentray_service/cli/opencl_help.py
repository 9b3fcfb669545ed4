"""The command that installs a usable OpenCL device."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bentray_kernels.opencl import DeviceSelection


def help_of(choice: DeviceSelection) -> str:
    """The command, with a comment after ``#``; empty if a device is chosen."""
    from bentray_kernels.opencl.devices import hidden

    if choice.device is not None:
        return ""
    if reason := hidden():
        return f"unset {reason.partition('=')[0]}  # shows the devices of this machine again"
    if Path(sys.prefix, "conda-meta").is_dir():
        return "conda install -c conda-forge pyopencl pocl  # a new PoCL, for x86-64 and Arm"
    if shutil.which("apt-get"):
        command = (
            "apt-get install pocl-opencl-icd" if os.geteuid() == 0 else "sudo apt-get install pocl-opencl-icd"
        )
        return f"{command}  # the distribution's PoCL, for x86-64 and Arm"
    if platform.machine() == "x86_64":
        command = f"{sys.executable} -m pip install intel-opencl-rt intel-cmplr-lib-rt"
        return f"{command}  # Intel's runtime; its licence forbids use in services for others"
    return "install PoCL with this system's package manager"
