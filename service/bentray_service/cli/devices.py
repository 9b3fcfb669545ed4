"""`bentray devices`: list and test the OpenCL devices."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from .opencl_help import help_of
from .output.terminal import AsJson, print_json, print_lines, print_table, progress_bar

if TYPE_CHECKING:
    from bentray_kernels.opencl import Choice, Device, Verdict


def devices(as_json: AsJson = False) -> None:
    """List and test the OpenCL devices, and show which one the method fim-opencl uses.

    A device that computes wrong results, aborts or hangs is rejected with the reason. Without a usable
    device, the computation runs without OpenCL. GPUs are preferred over CPUs. The variable
    BENTRAY_OPENCL_DEVICE selects a device by index or name; "none" hides all.

    Example:  bentray devices --json
    """
    from bentray_kernels.opencl import choose, find_devices, verdict_on

    records = find_devices()
    verdicts: list[Verdict] = []
    with progress_bar("Testing OpenCL devices") as step:
        for device in records:
            step(len(verdicts), len(records), device.name)
            verdicts.append(verdict_on(device))
    choice = choose()
    chosen = choice.device.index if choice.device is not None else None
    if as_json:
        rows = [_figures(device, verdict) for device, verdict in zip(records, verdicts, strict=True)]
        print_json({"chosen": chosen, "reason": choice.reason, "help": help_of(choice), "devices": rows})
        return
    if records:
        columns = ("index", "platform", "device", "kind", "driver", "verdict", "remarks")
        cells = [
            (d.index, d.platform, d.name, d.kind, d.driver, "usable" if v.usable else "refused", _remarks(v))
            for d, v in zip(records, verdicts, strict=True)
        ]
        print_table("OpenCL devices", columns, cells)
        print_lines(f"device {device.index} comes from {_source(device)}" for device in records)
    print_lines(_summary(choice, bool(records)))


def _figures(device: Device, verdict: Verdict) -> dict[str, object]:
    return {**asdict(device), "usable": verdict.usable, **asdict(verdict)}


def _remarks(verdict: Verdict) -> str:
    unneeded = "; ".join(f"{stage}: {fault}" for stage, fault in verdict.faults.items())
    return verdict.reason or (f"failed optional tests: {unneeded}" if unneeded else "")


def _source(device: Device) -> str:
    library = device.library or "an unknown library"
    return f"{device.package}: {library}" if device.package else library


def _summary(choice: Choice, found: bool) -> list[str]:
    device = choice.device
    if device is not None:
        return [f"fim-opencl uses device {device.index}, {device.label}"]
    reason = "no device passed" if found else choice.reason
    return [f"{reason}; fim-opencl computes without OpenCL, as fim", f"suggestion: {help_of(choice)}"]
