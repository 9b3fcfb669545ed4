"""Tasks that use traces: planned where they run, larger for larger scans, and counted."""

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
from bentray_workers.cluster.task_costs import bytes_of
from bentray_workers.files.dataset.counts import DatasetCounts
from bentray_workers.reconstruction.trace_sizes import (
    parts_of,
    reflection_bytes,
    reflection_seconds,
    reflection_task_sizes,
    reflection_tasks,
)


def echoes(elements, samples, water=False):
    turn = 2.0 * np.pi * np.arange(elements) / elements
    traces = np.random.default_rng(1).standard_normal((elements, elements, samples)).astype(np.float32)
    every = np.arange(elements)
    return Dataset(
        0.03 * np.column_stack((np.cos(turn), np.sin(turn))),
        every,
        every,
        1500.0,
        delta_tof_s=np.zeros((elements, elements)),
        waveform=Waveform(traces, traces if water else None),
        center_frequency_hz=1e6,
        sampling_rate_hz=5e6,
    )


def reflection(dataset, settings):
    return bytes_of(reflection_task_sizes(DatasetCounts.from_dataset(dataset).summary(settings), settings))


@pytest.mark.parametrize(("emissions", "samples"), [(1, 1), (7, 4_000_000), (256, 10**9), (100, 0)])
def test_parts_are_all_emissions_in_order(emissions, samples):
    parts = parts_of(emissions, samples)
    assert [e for part in parts for e in part] == list(range(emissions))


def test_tasks_of_a_reflection_image_are_those_that_are_planned():
    settings = Settings.from_values(method="sart", nodes=48, reflection=True)
    dataset = echoes(16, 300)
    corner = -0.033
    plan = plan_reflection(dataset, settings, np.full((48, 48), 1500.0), 0.066 / 47, (corner, corner))
    graph = ReflectionGraph((MemorySource(dataset), 0), plan, 300, 5e6)
    tasks, run = graph.first(), []
    while tasks:
        run.append(tasks.pop(0))
        tasks += graph.after(run[-1], run[-1].function(*run[-1].arguments))
    assert {task.function.__name__ for task in run} == set(reflection(dataset, settings))
    summary = DatasetCounts.from_dataset(dataset).summary(settings)
    assert len(run) == reflection_tasks(summary, settings)


def test_buffers_of_a_device_and_a_water_shot_are_planned():
    settings = Settings.from_values(method="sart", nodes=48, reflection=True)
    plain = reflection(echoes(24, 500), settings)
    for more in (
        reflection(echoes(24, 500), settings.changed(device="opencl")),
        reflection(echoes(24, 500, water=True), settings),
    ):
        assert more.pop("sum_emissions") > plain["sum_emissions"] + echoes(24, 500).waveform.object.nbytes
        assert all(size >= plain[name] for name, size in more.items())


@given(emissions=st.integers(8, 512), samples=st.integers(300, 3000), slices=st.integers(1, 9))
def test_planned_work_of_a_reflection_image_grows_with_the_scan(emissions, samples, slices):
    settings = Settings.from_values(method="sart", nodes=64, reflection=True)
    one = DatasetCounts.from_dataset(echoes(8, 8)).summary(settings)
    traces = replace(one.echoes, emissions=emissions, samples=samples)
    summary = replace(one, echoes=traces, slices=slices)
    wider = replace(summary, width_m=2.0 * summary.width_m)
    more = replace(summary, echoes=replace(traces, emissions=2 * emissions))
    for name, size in reflection_task_sizes(summary, settings).items():
        assert reflection_task_sizes(more, settings)[name].bytes >= size.bytes
        assert reflection_task_sizes(wider, settings)[name].bytes >= size.bytes
    assert reflection_tasks(more, settings) >= reflection_tasks(summary, settings)
    assert reflection_bytes(wider, settings) > reflection_bytes(summary, settings)
    assert reflection_seconds(more, settings) == pytest.approx(2.0 * reflection_seconds(summary, settings))


def test_no_reflection_image_is_planned_unless_it_is_requested():
    settings = Settings.from_values(method="sart", nodes=64)
    summary = DatasetCounts.from_dataset(echoes(8, 8)).summary(settings)
    assert reflection_task_sizes(summary, settings) == {}
    assert reflection_tasks(summary, settings) == reflection_bytes(summary, settings) == 0
    assert reflection_seconds(summary, settings) == 0.0
