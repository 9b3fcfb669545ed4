"""Plans of simulations: what does not fit is refused by name, and more of anything takes more."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_workers.cluster.capacities import MIB, WorkerCapacity
from bentray_workers.simulation import simulation_planning
from bentray_workers.simulation.parts import parts_of
from bentray_workers.simulation.request import PhantomScan
from bentray_workers.simulation.simulation_planning import plan_simulation

WORKER = WorkerCapacity(1024 * MIB, ("recon", "render"))
WAVES = PhantomScan(waveform=True)


@given(
    asked=st.sampled_from(
        [
            PhantomScan(),
            PhantomScan(attenuation=True),
            PhantomScan(phantom="table7", slices=3, nodes=64),
            WAVES,
            PhantomScan(phantom="table7", waveform=True),
        ]
    ),
    more=st.sampled_from(["elements", "nodes"]),
    by=st.integers(64, 128),
)
def test_more_of_anything_takes_more(asked, more, by):
    before = plan_simulation(asked, [WORKER])
    after = plan_simulation(replace(asked, **{more: getattr(asked, more) + by}), [WORKER])
    assert after.minutes >= before.minutes
    assert after.result_bytes >= before.result_bytes
    assert all(after.call_bytes[name] >= size for name, size in before.call_bytes.items())
    assert after.result_bytes + max(after.call_bytes.values()) > (
        before.result_bytes + before.to_dict()["largest_bytes"]
    )
    assert plan_simulation(asked, [WORKER] * 4).minutes < before.minutes
    parts = parts_of(asked.chosen())
    assert before.tasks == len(parts) + 1


@given(st.integers(1, 300), st.integers(16, 128), st.integers(2, 3))
def test_every_emitter_is_in_one_part(elements, nodes, slices):
    asked = PhantomScan(phantom="table7", elements=elements + 2, nodes=nodes, slices=slices)
    found = [(part.scan, k) for part in parts_of(asked.chosen()) for k in range(part.first, part.last)]
    assert found == [(scan, k) for scan in range(slices) for k in range(elements + 2)]


@pytest.mark.parametrize(
    ("asked", "field"),
    [
        (PhantomScan(refinement=60), "nodes"),
        (PhantomScan(elements=4096, attenuation=True, snr=9.0), "elements"),
        (PhantomScan(phantom="table7", three_d=True, refinement=4), "nodes"),
        (PhantomScan(waveform=True, frequency_hz=5e6), "frequency_hz"),
        (PhantomScan(phantom="table7", waveform=True, frequency_hz=4e5), "frequency_hz"),
        (PhantomScan(waveform=True, elements=4096, side_m=0.45), "elements"),
        (PhantomScan(phantom="table7", elements=4096, slices=1000), "elements"),
    ],
)
def test_rejects_grids_larger_than_worker_memory(asked, field):
    with pytest.raises(InvalidInput, match=rf"^{field}: .*; accepted: .*bytes"):
        plan_simulation(
            asked, [WORKER, WorkerCapacity(64 * MIB, ("recon",)), WorkerCapacity(2**50, ("render",))]
        )


def test_rejects_oversize_files_and_too_many_tasks(monkeypatch):
    with pytest.raises(InvalidInput, match=r"elements: found .* a file of"):
        plan_simulation(PhantomScan(phantom="table7", elements=4096, slices=1000), [])
    monkeypatch.setattr(simulation_planning, "MAX_TASKS", 20)
    with pytest.raises(InvalidInput, match="at most 20 tasks"):
        plan_simulation(WAVES, [])


def test_without_workers_it_is_planned_for_one():
    alone, none = plan_simulation(WAVES, [WORKER]), plan_simulation(WAVES, [])
    assert (alone.minutes, alone.workers, none.workers) == (none.minutes, 1, 0)
    assert "none is connected yet" in none.why
