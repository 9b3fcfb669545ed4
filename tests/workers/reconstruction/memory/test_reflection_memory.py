"""The planned memory of a reflection image is what its tasks allocate; it grows with the scan."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.reflection.reflection_graph import ReflectionGraph
from bentray_kernels.tomography.reflection.reflection_plan import plan_reflection
from bentray_kernels.tomography.scan import MemorySource
from bentray_workers.cluster.capacities import MIB
from bentray_workers.files.dataset.counts import DatasetCounts
from bentray_workers.reconstruction.memory.reflection_memory import (
    FLOOR_BYTES,
    reflection_bytes,
    reflection_seconds,
    reflection_task_bytes,
    reflection_tasks,
)

from ....memory_program import peak_of

RADIUS, WATER, CENTRE_HZ, RATE_HZ = 0.03, 1500.0, 1e6, 5e6


def scan(elements, samples, water=False):
    turn = 2.0 * np.pi * np.arange(elements) / elements
    ring = RADIUS * np.column_stack((np.cos(turn), np.sin(turn)))
    traces = np.random.default_rng(1).standard_normal((elements, elements, samples)).astype(np.float32)
    return Dataset(
        ring,
        np.arange(elements),
        np.arange(elements),
        WATER,
        delta_tof_s=np.zeros((elements, elements)),
        waveform=Waveform(traces, traces if water else None),
        center_frequency_hz=CENTRE_HZ,
        sampling_rate_hz=RATE_HZ,
    )


def test_buffers_of_a_device_are_planned():
    settings = Settings.from_values(method="sart", nodes=48, reflection=True)
    dataset = scan(24, 500)
    here, there = (
        reflection_task_bytes(DatasetCounts.from_dataset(dataset).summary(one), one)
        for one in (settings, settings.changed(device="opencl"))
    )
    assert there["sum_emissions"] > here["sum_emissions"] + dataset.waveform.object.nbytes
    assert there["solve_element_times"] == here["solve_element_times"]


@pytest.mark.parametrize(
    ("elements", "samples", "water", "changes"),
    [
        (24, 1500, True, {}),
        pytest.param(24, 1500, False, {}, marks=pytest.mark.nightly),
        pytest.param(96, 1500, True, {}, marks=pytest.mark.nightly),
        pytest.param(48, 300, False, {"nodes": 96}, marks=pytest.mark.nightly),
        pytest.param(16, 200, False, {"pixel_m": 6e-5}, marks=pytest.mark.nightly),
    ],
)
def test_tasks_allocate_what_is_planned(elements, samples, water, changes):
    settings = Settings.from_values(**{"method": "sart", "nodes": 48, "reflection": True, **changes})
    dataset = scan(elements, samples, water)
    nodes = settings.grid_nodes
    corner = -1.1 * RADIUS
    speed = np.full((nodes, nodes), WATER)
    plan = plan_reflection(dataset, settings, speed, -2.0 * corner / (nodes - 1), (corner, corner))
    graph = ReflectionGraph((MemorySource(dataset), 0), plan, samples, RATE_HZ)
    summary = DatasetCounts.from_dataset(dataset).summary(settings)
    planned = reflection_task_bytes(summary, settings)
    tasks, taken = graph.first(), {}
    while tasks:
        task = tasks.pop(0)
        # Kernels are compiled or loaded, and FFT plans made.
        result, name = task.function(*task.arguments), task.function.__name__
        peak = peak_of(lambda task=task: task.function(*task.arguments))
        taken[name] = max(peak, taken.get(name, 0))
        tasks += graph.after(task, result)
    assert set(taken) == set(planned)
    # Blocks of a file are not read here. The arguments and arrays of kernels are not traced, and planned too.
    blocks = 2 * (1 + water) * summary.echoes.read_bytes
    wrong = {
        name: (planned[name], peak)
        for name, peak in taken.items()
        if not peak <= planned[name] <= blocks + 2.5 * peak + FLOOR_BYTES + 6 * MIB
    }
    assert not wrong


@given(emissions=st.integers(8, 512), samples=st.integers(300, 3000), slices=st.integers(1, 9))
def test_planned_work_grows_with_the_scan(emissions, samples, slices):
    settings = Settings.from_values(method="sart", nodes=64, reflection=True)
    one = DatasetCounts.from_dataset(scan(8, 8)).summary(settings)
    traces = replace(one.echoes, emissions=emissions, samples=samples)
    summary = replace(one, echoes=traces, slices=slices)
    wider = replace(summary, width_m=2.0 * summary.width_m)
    more = replace(summary, echoes=replace(traces, emissions=2 * emissions))
    for name, size in reflection_task_bytes(summary, settings).items():
        assert reflection_task_bytes(more, settings)[name] >= size
        assert reflection_task_bytes(wider, settings)[name] >= size
    assert reflection_tasks(more, settings) >= reflection_tasks(summary, settings)
    assert reflection_bytes(wider, settings) > reflection_bytes(summary, settings)
    assert reflection_seconds(more, settings) == pytest.approx(2.0 * reflection_seconds(summary, settings))


def test_a_water_shot_is_planned():
    settings = Settings.from_values(method="sart", nodes=48, reflection=True)
    without, with_it = (
        reflection_task_bytes(DatasetCounts.from_dataset(scan(24, 500, water)).summary(settings), settings)
        for water in (False, True)
    )
    dataset = scan(24, 500)
    more = with_it.pop("sum_emissions") - without.pop("sum_emissions")
    assert more > 2 * dataset.waveform.object.nbytes
    assert with_it == without


def test_nothing_is_planned_unless_it_is_requested():
    settings = Settings.from_values(method="sart", nodes=64)
    summary = DatasetCounts.from_dataset(scan(8, 8)).summary(settings)
    assert reflection_task_bytes(summary, settings) == {}
    assert reflection_tasks(summary, settings) == reflection_bytes(summary, settings) == 0
    assert reflection_seconds(summary, settings) == 0.0
