"""Tables of memory, disk space and processor time of reconstructions: planned, and measured."""

import json
from pathlib import Path
from typing import Any

from bentray_kernels.tomography import Settings
from bentray_workers.files.dataset.counts import DatasetCounts
from bentray_workers.reconstruction.planning import plan

from .tables import table

# Elements of a ring, nodes along each side of the image, and slices.
SIZES = ((64, 96, 1), (128, 128, 1), (256, 192, 1), (256, 192, 40), (512, 256, 1), (512, 256, 44))
METHODS = ("sart", "gauss-newton")
MIB = 2.0**20
# Ends of the labels of rows.
MEMORY, DISK = ": memory above a warm worker", ": disk"
ROWS = Path(__file__).resolve().parents[2] / "benchmarks" / "results" / "sizing.json"


def sizing() -> str:
    """One row for each size and method: the largest task, result with checkpoints, seconds of a core."""
    rows = []
    for elements, nodes, slices in SIZES:
        for method in METHODS:
            settings = Settings.from_values(method=method, nodes=nodes, attenuation={"enabled": False})
            planned = plan(_scan(elements, slices).summary(settings), settings, ())
            memory, disk = planned.largest[1] / MIB, planned.stored_bytes / MIB
            size = f"{elements}", f"{nodes}²", f"{slices}", method
            rows.append((*size, f"{memory:.0f} MiB", f"{disk:.0f} MiB", f"{planned.work_s:.0f} s"))
    head = ("elements", "nodes", "slices", "method", "largest task", "disk while it runs", "one core")
    return table(head, rows)


def measured_sizing(file: Path = ROWS) -> str:
    """One row for each size and method of ``bentray bench sizing``; bold where a plan is exceeded."""
    recorded = {row["target"]: row for row in json.loads(file.read_text())}
    rows = []
    for target, memory in recorded.items():
        if not target.endswith(MEMORY):
            continue
        disk, figures = recorded[target.removesuffix(MEMORY) + DISK], memory["figures"]
        elements, nodes, slices = (f"{figures[name]:.0f}" for name in ("elements", "nodes", "slices"))
        seconds = f"{figures['CPU, s']:.1f} s", f"{figures['planned CPU, s']:.0f} s"
        method = target.removesuffix(MEMORY).rpartition(", ")[2]
        files = (f"{figures[f'{name}, MiB']:.1f} MiB" for name in ("scan", "checkpoints", "volume"))
        cells = (*_beside_plan(memory), *seconds, *files, f"{disk['goal']:.1f} MiB")
        rows.append((elements, f"{nodes}²", slices, method, *cells))
    head = ("elements", "nodes", "slices", "method", "memory", "planned", "CPU", "planned", "scan")
    return table((*head, "checkpoints", "volume", "both planned"), rows)


def _beside_plan(row: dict[str, Any]) -> tuple[str, str]:
    measured = f"{row['value']:.0f} MiB"
    return measured if row["met"] else f"**{measured}**", f"{row['goal']:.0f} MiB"


def _scan(elements: int, slices: int) -> DatasetCounts:
    return DatasetCounts(
        emissions=elements,
        receivers=elements,
        elements=elements,
        slices=slices,
        in_space=False,
        height_m=0.004 * (slices - 1),
        width_m=0.16,
        times=True,
        amplitudes=False,
        traces_bytes=0,
        samples=0,
        sample_bytes=0,
        rate_hz=None,
        frequency_hz=None,
        water_mps=1500.0,
    )
