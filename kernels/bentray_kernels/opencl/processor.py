"""What this machine's processor is and can do, in the words of the Linux kernel."""

from __future__ import annotations

from functools import cache
from pathlib import Path

CPUINFO = Path("/proc/cpuinfo")

# Lines that tell one model from another, on x86 and on Arm; the others change by the core or by the second.
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
    told: set[str] = set()
    for line in first.splitlines():
        name, _, value = line.partition(":")
        if name.strip() in FEATURES:
            told.update(value.split())
        elif name.strip() in MODEL:
            told.add(f"{name.strip()}: {value.strip()}")
    return frozenset(told)
