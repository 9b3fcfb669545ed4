"""Model and features of this machine's processor, from /proc/cpuinfo."""

from functools import cache
from pathlib import Path

CPUINFO = Path("/proc/cpuinfo")

# Lines that identify a model, on x86 and on Arm; the others vary by core or over time.
MODEL = (
    "vendor_id",
    "cpu family",
    "model",
    "model name",
    "stepping",
    "CPU implementer",
    "CPU variant",
    "CPU part",
)
FEATURES = ("flags", "Features")


@cache
def processor() -> frozenset[str]:
    """Features of the first processor ("avx2") and its model ("cpu family: 26"), or nothing."""
    try:
        first = CPUINFO.read_text().partition("\n\n")[0]
    except OSError:
        return frozenset()
    features: set[str] = set()
    for line in first.splitlines():
        name, _, value = line.partition(":")
        if name.strip() in FEATURES:
            features.update(value.split())
        elif name.strip() in MODEL:
            features.add(f"{name.strip()}: {value.strip()}")
    return frozenset(features)
