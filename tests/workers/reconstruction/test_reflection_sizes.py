"""The planned memory of a reflection image is what its tasks allocate; it grows with the scan."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.tomography import Settings
from bentray_workers.files.dataset.counts import DatasetCounts
from bentray_workers.reconstruction.reflection_sizes import (
    reflection_bytes,
    reflection_seconds,
    reflection_task_sizes,
    reflection_tasks,
)

RADIUS, WATER, CENTRE_HZ, RATE_HZ = 0.03, 1500.0, 1e6, 5e6


def reflection_task_bytes(summary, settings):
    return {name: size.bytes for name, size in reflection_task_sizes(summary, settings).items()}


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
    assert with_it["sum_emissions"] - without["sum_emissions"] > 2 * dataset.waveform.object.nbytes


def test_nothing_is_planned_unless_it_is_requested():
    settings = Settings.from_values(method="sart", nodes=64)
    summary = DatasetCounts.from_dataset(scan(8, 8)).summary(settings)
    assert reflection_task_bytes(summary, settings) == {}
    assert reflection_tasks(summary, settings) == reflection_bytes(summary, settings) == 0
    assert reflection_seconds(summary, settings) == 0.0
