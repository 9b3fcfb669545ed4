"""OpenCL devices: selection by name, self-test and trial in a child process, placement, sessions."""

from .choice import Choice, OpenCLFallbackWarning, choose, scene_or_warning, session_or_warning
from .devices import VARIABLE, WISH, Device, find_devices
from .lost_device import DeviceLostError, computed, computing_on, on_cpu, with_cpu_retry
from .placement import DeviceRequest, Work, check_available, place, requested
from .session import Session
from .trial import ENGINES, Trial, trial_of
from .verdict import Verdict, verdict_on

__all__ = [
    "ENGINES",
    "VARIABLE",
    "WISH",
    "Choice",
    "Device",
    "DeviceLostError",
    "DeviceRequest",
    "OpenCLFallbackWarning",
    "Session",
    "Trial",
    "Verdict",
    "Work",
    "check_available",
    "choose",
    "computed",
    "computing_on",
    "find_devices",
    "on_cpu",
    "place",
    "requested",
    "scene_or_warning",
    "session_or_warning",
    "trial_of",
    "verdict_on",
    "with_cpu_retry",
]
