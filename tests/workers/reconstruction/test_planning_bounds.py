"""Plans of the largest datasets that are taken: of counts alone, in steps and memory that do not grow."""

import sys
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.requests.limits import (
    ELEMENTS,
    EMISSIONS,
    FREQUENCY_HZ,
    PAIRS,
    RECEIVERS,
    SAMPLES,
    SAMPLING_HZ,
    SLICES,
    SPEED_MPS,
    WIDTH_M,
)
from bentray_kernels.tomography import Settings
from bentray_workers.cluster.capacities import MIB, WorkerCapacity
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.dataset.counts import DatasetCounts
from bentray_workers.files.dataset.scan import counts_in
from bentray_workers.reconstruction.planning import plan
from bentray_workers.simulation.parts import count_of, parts_of
from bentray_workers.simulation.request import PhantomScan
from bentray_workers.simulation.simulation_planning import plan_simulation

from ...memory_program import peak_of
from ..files.datasets import datasets

WAYS = [
    {},
    {"method": "gauss-newton", "resolution_check": True, "uncertainty": True},
    {"method": "auto", "minutes": 100.0},
    {"method": "waveform"},
    {"decomposition": "volume"},
    {"amplitudes": "ratio"},
]
OFFERS = [WorkerCapacity(0, ("recon", "render"))]
SMALL = DatasetCounts(256, 256, 256, 2, False, 0.004, 0.2, False, True, 2**30, 4000, 2, 2.5e7, 1e6, 1500.0)
LARGEST = DatasetCounts(
    EMISSIONS.most,
    RECEIVERS.most,
    ELEMENTS.most,
    SLICES.most,
    False,
    WIDTH_M.most,
    WIDTH_M.most,
    False,
    True,
    2**35,
    SAMPLES.most,
    4,
    SAMPLING_HZ.most,
    1e6,
    1500.0,
)


def planned(counts, settings):
    return plan(counts.summary(settings), settings, OFFERS)


def steps(work):
    """Lines that ran, and the most memory that it took beside what was there."""
    count = 0

    def look(_frame, event, _value):
        nonlocal count
        count += event == "line"
        return look

    before = sys.gettrace()
    sys.settrace(look)
    try:
        work()
    finally:
        sys.settrace(before)
    return count, peak_of(work)


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_the_largest_dataset_is_planned_in_as_many_steps_as_a_small_one(way):
    settings = Settings.from_values(**{"method": "sart", **way})
    few, _ = steps(lambda: planned(SMALL, settings))
    many, taken = steps(lambda: planned(LARGEST, settings))
    assert many <= 1.5 * few
    # Mostly the checks of settings: the time of each candidate of auto is counted too.
    assert many < 60_000
    assert taken < MIB


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_rejecting_the_largest_dataset_takes_few_steps(way):
    settings = Settings.from_values(**{"method": "sart", **way})
    little = [WorkerCapacity(2048 * MIB, ("recon", "render"))]

    def refused():
        with pytest.raises(InvalidInput):
            plan(LARGEST.summary(settings), settings, little)

    many, taken = steps(refused)
    # Mostly the checks of settings: the time of each candidate of auto is counted too.
    assert many < 60_000
    assert taken < 2 * MIB


numbers = {
    "emissions": EMISSIONS,
    "receivers": RECEIVERS,
    "elements": ELEMENTS,
    "slices": SLICES,
    "samples": SAMPLES,
}


@given(
    **{name: st.integers(within.least, within.most) for name, within in numbers.items()},
    in_space=st.booleans(),
    height_m=st.floats(0.0, WIDTH_M.most),
    width_m=st.floats(WIDTH_M.least, WIDTH_M.most),
    times=st.booleans(),
    amplitudes=st.booleans(),
    traces_bytes=st.integers(0, 2**36),
    sample_bytes=st.sampled_from([2, 4]),
    rate_hz=st.none() | st.floats(SAMPLING_HZ.least, SAMPLING_HZ.most),
    frequency_hz=st.none() | st.floats(FREQUENCY_HZ.least, FREQUENCY_HZ.most),
    water_mps=st.floats(SPEED_MPS.least, SPEED_MPS.most),
    way=st.sampled_from(WAYS),
)
def test_every_dataset_within_the_limits_has_a_plan(way, **counts):
    settings, known = Settings.from_values(**{"method": "sart", **way}), DatasetCounts(**counts)
    if settings.method == "waveform" and (known.summary(settings).traces is None or known.in_space):
        with pytest.raises(InvalidInput, match=r"for (a scan without traces|elements in space)"):
            planned(known, settings)
        return
    result = planned(known, settings)
    assert result.tasks > 0
    assert all(size > 0 for size in result.call_bytes.values())
    assert len(result.why) < 1000


@pytest.mark.parametrize("width_m", [0.0, 1e-300, 1e300, float("inf"), float("nan")])
def test_an_array_of_no_width_that_was_taken_in_before_has_no_plan(width_m):
    for way in WAYS:
        with pytest.raises(InvalidInput, match="element_position_m"):
            planned(replace(SMALL, width_m=width_m), Settings.from_values(**{"method": "sart", **way}))


@given(dataset=datasets())
def test_the_counts_of_a_dataset_are_those_of_its_file(dataset, tmp_path_factory):
    path = tmp_path_factory.mktemp("counts") / "scan.h5"
    write_dataset(path, dataset)
    known = DatasetCounts.from_dataset(dataset)
    # A missing frequency is estimated from the traces of the file.
    counted = counts_in(path)
    assert counted == (
        replace(known, frequency_hz=counted.frequency_hz) if known.frequency_hz is None else known
    )
    assert DatasetCounts(**known.to_dict()) == known
    assert PAIRS.holds(known.summary(Settings(method="sart")).pairs)


@pytest.mark.parametrize(
    "asked",
    [{}, {"phantom": "table7", "slices": 3}, {"waveform": True}, {"phantom": "table7", "refinement": 8}],
    ids=str,
)
def test_parts_of_a_simulation_are_counted_without_being_made(asked):
    settings = PhantomScan(**asked).chosen()
    assert count_of(settings) == len(parts_of(settings))


def test_the_largest_simulation_is_rejected_in_few_steps():
    largest = {"phantom": "table7", "slices": 1024, "nodes": 1024, "refinement": 4}

    def refused():
        with pytest.raises(InvalidInput, match="elements"):
            plan_simulation(PhantomScan(**largest, elements=1400), OFFERS)

    assert steps(refused)[1] < 2 * MIB
