"""OpenCL devices: selection by name, self-test in a child process, sessions."""

from .choice import Choice, OpenCLFallbackWarning, choose, scene_or_warning, session_or_warning
from .devices import WISH, Device, find_devices
from .session import Session
from .verdict import Verdict, verdict_on

__all__ = [
    "WISH",
    "Choice",
    "Device",
    "OpenCLFallbackWarning",
    "Session",
    "Verdict",
    "choose",
    "find_devices",
    "scene_or_warning",
    "session_or_warning",
    "verdict_on",
]
