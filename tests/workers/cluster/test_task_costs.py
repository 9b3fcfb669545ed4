"""The table of task costs: sums of counts times coefficients, complete for every task that is planned."""

import math
from dataclasses import replace
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels import eikonal
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_workers.cluster import task_costs
from bentray_workers.cluster.task_costs import FIXED, TaskSize, table
from bentray_workers.files.dataset.counts import Summary, Traces
from bentray_workers.reconstruction.planning import call_sizes
from bentray_workers.reconstruction.ray_task_sizes import front_size
from bentray_workers.reconstruction.reflection_sizes import reflection_task_sizes
from bentray_workers.reconstruction.waveform_sizes import wave_task_sizes

MADE_UP = {
    "bytes": {"draw": {FIXED: 100.0, "pixels": 4.5, "rays": 2.0}},
    "seconds": {"draw": {FIXED: 0.25, "rays": 1e-6}},
}


@pytest.fixture
def made_up(monkeypatch):
    monkeypatch.setattr(task_costs, "table", lambda: MADE_UP)


def test_a_cost_is_the_sum_of_counts_times_coefficients(made_up):
    size = TaskSize("draw", {"pixels": 3, "rays": 10, "not in the table": 9})
    assert size.bytes == 100 + 14 + 20
    assert size.parts == {FIXED: 100, "pixels": 14, "rays": 20}
    assert TaskSize("draw", {"rays": 2_000_000}).seconds == pytest.approx(2.25)


def test_unknown_kinds_and_missing_counts_are_errors(made_up):
    with pytest.raises(KeyError, match="paint"):
        _ = TaskSize("paint", {}).bytes
    with pytest.raises(KeyError, match="pixels"):
        _ = TaskSize("draw", {"rays": 1}).bytes


@given(
    kind=st.sampled_from(sorted(table()["bytes"])), count=st.integers(0, 10**6), more=st.integers(0, 10**6)
)
def test_more_never_takes_less(kind, count, more):
    names = [name for name in table()["bytes"][kind] if name != FIXED]
    before, after = (TaskSize(kind, dict.fromkeys(names, n)).bytes for n in (count, count + more))
    assert 0 <= before <= after


@pytest.mark.parametrize("quantity", ["bytes", "seconds"])
def test_coefficients_are_finite_and_not_negative(quantity):
    for kind, coefficients in table()[quantity].items():
        assert coefficients, kind
        assert all(math.isfinite(each) and each > 0.0 for each in coefficients.values()), kind


def test_every_travel_time_has_a_size():
    for method, shape in product(eikonal.methods(), ((40, 40), (20, 20, 10))):
        assert front_size(shape, method).bytes > 0


TRACES = Traces(64, 64, 500, 4, 2e6, 2e5, 1500.0)


EACH = list(product(("slices", "volume"), (True, False), ("cpu", "opencl")))


@pytest.mark.parametrize(("decomposition", "water", "device"), EACH)
def test_every_planned_task_is_in_the_table(decomposition, water, device):
    shots = replace(TRACES, water_shot=water)
    scan = Summary(64, 64, 2 * 64**2, 2, False, 0.05, 0.16, 2**20, True, shots, period=True, echoes=shots)
    flags = {"resolution_check": True, "uncertainty": True, "attenuation": True}
    others = {}, flags, {"blocks": 2}
    for method, rays, more in product(("sart", "gauss-newton"), ("curved", "straight"), others):
        names = {"method": method, "rays": rays, "decomposition": decomposition, "nodes": 64}
        try:
            settings = Settings.from_values(**names, device=device, **more)
        except InvalidInput:
            continue
        assert all(size.bytes > 0 for size in call_sizes(scan, settings).values())
    for changes in ({"method": "auto"}, {"method": "waveform"}, {"method": "sart", "reflection": True}):
        settings = Settings.from_values(**changes, nodes=64, device=device)
        sizes = wave_task_sizes(shots, 0.16, settings) | reflection_task_sizes(scan, settings)
        assert sizes
        assert all(size.bytes > 0 for size in sizes.values())
