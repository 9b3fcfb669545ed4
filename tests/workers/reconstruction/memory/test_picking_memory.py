"""Memory of examination and picking: as planned, and far less than the traces."""

import pytest

from bentray_kernels.tomography import Settings
from bentray_workers.files.dataset.scan import counts_in
from bentray_workers.reconstruction.memory.picking_memory import parts_of, picking_task_bytes

from ....memory_program import measured, wrong

MIB = 2**20


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize(
    ("picker", "elements", "samples", "water"),
    [("aic", 100, 2400, True), ("aic", 100, 2400, False), ("matched", 64, 1500, True)],
)
def test_tasks_stay_within_the_plan_and_never_load_all_traces(tmp_path, picker, elements, samples, water):
    taken = measured(f"{__package__}.picking_task_memory", str(tmp_path), picker, elements, samples, water)
    traces = taken.pop("traces")
    settings = Settings.from_values(method="sart", picker=picker)
    scan = counts_in(tmp_path / "scan.h5").summary(settings)
    told = picking_task_bytes(scan.traces, scan.pairs, settings)
    assert not wrong(told, taken, 1.5, 8 * MIB)
    if picker == "aic" and water:
        assert max(taken.values()) < 0.5 * traces


@pytest.mark.parametrize(("emissions", "samples"), [(1, 1), (7, 4_000_000), (256, 10**9), (100, 0)])
def test_parts_are_all_emissions_in_order(emissions, samples):
    parts = parts_of(emissions, samples)
    assert [e for part in parts for e in part] == list(range(emissions))
