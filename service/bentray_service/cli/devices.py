"""`bentray devices`: which OpenCL devices there are, and whether they compute right."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from .terminal import AsJson, print_json, print_lines, print_table, progress_bar

if TYPE_CHECKING:
    from bentray_kernels.opencl import Device, Verdict


def devices(as_json: AsJson = False) -> None:
    """Try every OpenCL device of this machine and say which one the method fim-opencl uses.

    A device that computes wrongly, aborts or hangs is refused with the reason; where none is left, the
    same is computed without OpenCL. The variable BENTRAY_OPENCL_DEVICE chooses one by index or name.

    Example:  bentray devices --json
    """
    from bentray_kernels.opencl import choose, find_devices, verdict_on

    found = find_devices()
    verdicts: list[Verdict] = []
    with progress_bar("Trying OpenCL devices") as step:
        for device in found:
            step(len(verdicts), len(found), device.name)
            verdicts.append(verdict_on(device))
    choice = choose()
    chosen = choice.device.index if choice.device is not None else None
    if as_json:
        rows = [_figures(device, verdict) for device, verdict in zip(found, verdicts, strict=True)]
        print_json({"chosen": chosen, "devices": rows})
        return
    if found:
        columns = ("index", "platform", "device", "kind", "driver", "verdict", "remarks")
        cells = [
            (d.index, d.platform, d.name, d.kind, d.driver, "usable" if v.usable else "refused", _remarks(v))
            for d, v in zip(found, verdicts, strict=True)
        ]
        print_table("OpenCL devices", columns, cells)
    print_lines([_summary(choice.device, bool(found))])


def _figures(device: Device, verdict: Verdict) -> dict[str, object]:
    return {**asdict(device), "usable": verdict.usable, **asdict(verdict)}


def _remarks(verdict: Verdict) -> str:
    unneeded = "; ".join(f"{stage}: {fault}" for stage, fault in verdict.faults.items())
    return verdict.reason or (f"not needed and not used: {unneeded}" if unneeded else "")


def _summary(device: Device | None, found: bool) -> str:
    if device is not None:
        return f"fim-opencl uses device {device.index}, {device.label}"
    reason = "no device passed" if found else "no OpenCL device found"
    return f"{reason}; fim-opencl computes without OpenCL, as fim"
