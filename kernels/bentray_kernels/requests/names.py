"""Names of methods and engines that users may choose; without an import of their compiled code."""

from typing import Literal, get_args

# Eikonal solvers of reconstructions. ``deviation`` solves for the difference from straight rays; the others
# are those of ``eikonal.registry``.
SolverName = Literal[
    "deviation",
    "fmm",
    "fmm-first-order",
    "fmm-untidy",
    "hafmm",
    "fsm",
    "fsm-simultaneous",
    "fim",
    "fim-opencl",
    "accurate",
]

# How ∇(T²) is read between the nodes: central differences at them, interpolated multilinearly; or the
# gradient of the cubic B-spline of T², as in chapter 6.3.
RayGradient = Literal["differences", "bspline"]

# Pickers of first arrivals.
PickerName = Literal["aic", "threshold", "energy-ratio", "sta-lta", "correlation", "matched"]
DEFAULT_PICKER: PickerName = "aic"

# The axis of an object that is up in a picture.
UpAxis = Literal["auto", "z", "y", "x", "-z", "-y", "-x"]

# Where a user wants engines to compute.
DeviceRequest = Literal["auto", "cpu", "opencl"]
REQUESTS: tuple[str, ...] = get_args(DeviceRequest)
DESCRIPTION = (
    "Where to compute what exists for OpenCL devices too. auto: on the device where a benchmark on this "
    "machine was faster; cpu: never on a device; opencl: on the device, an error without one."
)
