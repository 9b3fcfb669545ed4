"""OpenCL devices: selection of device and engine, self-test and benchmark in a child process, sessions."""

from .device_benchmark import ENGINES, DeviceBenchmark, benchmark_of
from .device_selection import DeviceSelection, OpenCLFallbackWarning, select_device, session_or_warning
from .devices import VARIABLE, Device, find_devices
from .engine_selection import Work, check_available, requested, select_engine
from .lost_device import DeviceLostError, computed, computing_on, with_cpu_retry
from .self_test_results import SelfTestResult, self_test_result
from .session import Session

__all__ = [
    "ENGINES",
    "VARIABLE",
    "Device",
    "DeviceBenchmark",
    "DeviceLostError",
    "DeviceSelection",
    "OpenCLFallbackWarning",
    "SelfTestResult",
    "Session",
    "Work",
    "benchmark_of",
    "check_available",
    "computed",
    "computing_on",
    "find_devices",
    "requested",
    "select_device",
    "select_engine",
    "self_test_result",
    "session_or_warning",
    "with_cpu_retry",
]
