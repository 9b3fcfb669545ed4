"""`bentray devices`: list, test and measure the OpenCL devices; the command that installs one."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bentray_kernels.errors import InvalidInput

from .output.terminal import AsJson, print_json, print_lines, print_table, progress_bar

if TYPE_CHECKING:
    from bentray_kernels.device_engines import Comparison
    from bentray_kernels.opencl import Device, DeviceBenchmark, DeviceSelection, SelfTestResult


def devices(
    bench: Annotated[
        bool, typer.Option("--bench", help="Also measure every engine on the chosen device: minutes.")
    ] = False,
    quick: Annotated[bool, typer.Option("--quick", help="With --bench: small problems only.")] = False,
    as_json: AsJson = False,
) -> None:
    """List and test the OpenCL devices, and show what computes on the chosen one.

    A device that computes wrong results, aborts or hangs is rejected with the reason. On the chosen device a
    benchmark times each engine beside compiled code; `--device auto` follows it. Both results are stored
    until the driver or Bentray changes. GPUs are preferred over CPUs. The variable BENTRAY_OPENCL_DEVICE
    selects a device by index or name, "none" hides all; BENTRAY_DEVICE is auto, cpu or opencl.

    Example:  bentray devices --bench
    """
    from bentray_kernels.opencl import (
        ENGINES,
        benchmark_of,
        find_devices,
        requested,
        select_device,
        self_test_result,
    )

    if quick and not bench:
        raise InvalidInput("--quick", "given without --bench", "--bench --quick")
    request = requested()
    records = find_devices()
    verdicts: list[SelfTestResult] = []
    with progress_bar("Testing OpenCL devices") as step:
        for device in records:
            step(len(verdicts), len(records) + len(ENGINES), device.name)
            verdicts.append(self_test_result(device))
        choice = select_device()
        trials: dict[str, DeviceBenchmark] = {}
        if choice.device is not None:
            for engine in ENGINES:
                step(len(records) + len(trials), len(records) + len(ENGINES), engine)
                trials[engine] = benchmark_of(choice.device, engine)
    compared = _compared(quick=quick) if bench and choice.device is not None else []
    if as_json:
        print_json(_figures(records, verdicts, choice, trials, compared) | {"device": request})
        return
    if records:
        columns = ("index", "platform", "device", "kind", "memory", "driver", "verdict", "remarks")
        cells = [
            (
                d.index,
                d.platform,
                d.name,
                d.kind,
                f"{d.memory_bytes / 2**30:.1f} GiB" if d.memory_bytes else "unknown",
                d.driver,
                "usable" if v.usable else "refused",
                _remarks(v),
            )
            for d, v in zip(records, verdicts, strict=True)
        ]
        print_table("OpenCL devices", columns, cells)
        print_lines(f"device {device.index} comes from {_source(device)}" for device in records)
    if trials:
        _print_trials(trials)
    if compared and choice.device is not None:
        _print_compared(compared, choice.device)
    print_lines(_summary(choice, bool(records)))


def _compared(*, quick: bool) -> list[Comparison]:
    from bentray_kernels.device_engines import ENGINES_COMPARED, compare

    found: list[Comparison] = []
    with progress_bar("Measuring engines") as step:
        for one in compare(quick):
            found.append(one)
            step(len(found), ENGINES_COMPARED, one.engine.name)
    return found


def _figures(
    records: tuple[Device, ...],
    verdicts: list[SelfTestResult],
    choice: DeviceSelection,
    trials: dict[str, DeviceBenchmark],
    compared: list[Comparison],
) -> dict[str, object]:
    return {
        "chosen": None if choice.device is None else choice.device.index,
        "reason": choice.reason,
        "help": help_of(choice),
        "devices": [
            {**asdict(device), "usable": verdict.usable, **asdict(verdict)}
            for device, verdict in zip(records, verdicts, strict=True)
        ],
        "trial": {name: [one._asdict() for one in trial.timings] for name, trial in trials.items()},
        "trial_faults": {name: trial.fault for name, trial in trials.items() if trial.fault},
        "bench": [
            {
                "engine": one.engine.name,
                "compiled_s": one.compiled_s,
                "device_s": one.device_s,
                "difference": one.difference,
                "bound": one.engine.bound,
                "difference_unit": one.engine.error.unit,
                "bandwidth_share": one.bandwidth_share,
            }
            for one in compared
        ],
    }


def _print_trials(trials: dict[str, DeviceBenchmark]) -> None:
    """The trials, and what ``auto`` concludes from them."""
    cells: list[tuple[Any, ...]] = [
        (
            engine,
            f"{one.size:,.0f}",
            f"{1e3 * one.compiled_s:.3g} ms",
            f"{1e3 * one.device_s:.3g} ms",
            "device" if trial.faster(one.size) else "compiled",
        )
        for engine, trial in trials.items()
        for one in trial.timings
    ]
    cells += [(engine, "", "", trial.fault, "compiled") for engine, trial in trials.items() if trial.fault]
    print_table("Benchmark", ("engine", "size", "compiled", "device", "auto takes"), cells)


def _print_compared(compared: list[Comparison], device: Device) -> None:
    cells = [
        (
            one.engine.name,
            "wrong" if one.compiled_s is None else f"{1e3 * one.compiled_s:.3g} ms",
            "wrong" if one.device_s is None else f"{1e3 * one.device_s:.3g} ms",
            "" if not one.device_s else f"{(one.compiled_s or 0.0) / one.device_s:.2f}",
            "" if one.bandwidth_share is None else f"{one.bandwidth_share:.1%}",
            ""
            if one.difference is None
            else f"{one.difference:.2g} of {one.engine.bound:g} {one.engine.error.unit}",
        )
        for one in compared
    ]
    columns = ("engine", "compiled", "device", "times the speed", "of its bandwidth", "difference")
    print_table(f"Engines on {device.label}", columns, cells)


def _remarks(verdict: SelfTestResult) -> str:
    unneeded = "; ".join(f"{stage}: {fault}" for stage, fault in verdict.faults.items())
    return verdict.reason or (f"failed optional tests: {unneeded}" if unneeded else "")


def _source(device: Device) -> str:
    library = device.library or "an unknown library"
    return f"{device.package}: {library}" if device.package else library


def _summary(choice: DeviceSelection, found: bool) -> list[str]:
    device = choice.device
    if device is not None:
        return [f"chosen: device {device.index}, {device.label}"]
    reason = "no device passed" if found else choice.reason
    return [f"{reason}; compiled code computes everything", f"suggestion: {help_of(choice)}"]


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
