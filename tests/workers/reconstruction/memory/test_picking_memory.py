"""Memory of examination and picking: as planned, and far less than the traces."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from bentray_kernels.tomography import Settings
from bentray_workers.files.dataset.summary import summary_of
from bentray_workers.reconstruction.memory.picking_memory import parts_of, picking_task_bytes

PROGRAM = Path(__file__).with_name("picking_task_memory.py")
ROOT = Path(__file__).parents[4]
MIB = 2**20


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize(
    ("picker", "elements", "samples", "shots"),
    [("aic", 100, 2400, "water"), ("aic", 100, 2400, "object"), ("matched", 64, 1500, "water")],
)
def test_tasks_stay_within_the_plan_and_never_load_all_traces(tmp_path, picker, elements, samples, shots):
    # Freed arrays go back at once, so that a fork's peak is that of its own.
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join((str(ROOT), str(PROGRAM.parent))),
        "MALLOC_MMAP_THRESHOLD_": "65536",
        "MALLOC_TRIM_THRESHOLD_": "65536",
    }
    command = [sys.executable, str(PROGRAM), str(tmp_path), picker, str(elements), str(samples), shots]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    measured = json.loads(done.stdout)
    traces = measured.pop("traces")
    settings = Settings.from_values(method="sart", picker=picker)
    scan = summary_of(tmp_path / "scan.h5", settings)
    told = picking_task_bytes(scan.traces, scan.pairs, settings)
    assert set(told) == set(measured)
    wrong = {
        name: (told[name], taken)
        for name, taken in measured.items()
        if not taken <= told[name] <= 1.5 * taken + 8 * MIB
    }
    assert not wrong
    if (picker, shots) == ("aic", "water"):
        assert max(measured.values()) < 0.5 * traces


@pytest.mark.parametrize(("emissions", "samples"), [(1, 1), (7, 4_000_000), (256, 10**9), (100, 0)])
def test_parts_are_all_emissions_in_order(emissions, samples):
    parts = parts_of(emissions, samples)
    assert [e for part in parts for e in part] == list(range(emissions))
