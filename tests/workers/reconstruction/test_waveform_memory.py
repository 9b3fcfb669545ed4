"""Planned memory of full waveforms: of every automatic choice, and more for larger scans."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.opencl import session_or_warning
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.scan import MemorySource
from bentray_kernels.tomography.waveform.automatic_settings import scale_of, wave_settings
from bentray_kernels.tomography.waveform.band_inversion import Model
from bentray_kernels.tomography.waveform.refinement_graph import evaluate_emitter
from bentray_kernels.tomography.waveform.wave_scan import WaveScan
from bentray_kernels.wave.device_waves import DeviceWaves, Scan
from bentray_kernels.wave.simulation import place_elements
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.dataset.counts import Traces
from bentray_workers.files.dataset.scan import counts_in
from bentray_workers.reconstruction.waveform_memory import wave_task_bytes, wave_tasks

from ...kernels.tomography.waveform.scans import CENTRE_HZ, ELEMENTS, RADIUS, RATE_HZ, WATER, scan

SCAN = Traces(128, 128, 300, 4, 2.5e6, 2.5e5, 1500.0)


@given(
    bands=st.integers(1, 3),
    emissions=st.integers(8, 512),
    samples=st.integers(300, 3000),
    width=st.floats(0.05, 0.3),
)
def test_planned_memory_of_waves_is_monotonic(bands, emissions, samples, width):
    traces = replace(SCAN, emissions=emissions, samples=samples)
    settings = Settings.from_values(method="waveform", bands=bands)
    found = wave_task_bytes(traces, width, settings)
    # Beyond those that a band uses emissions do not count, but where they are read in blocks.
    many = wave_task_bytes(replace(traces, emissions=emissions + 64), width, settings)
    assert all(many[name] >= size for name, size in found.items())
    assert emissions < 64 or many["evaluate_emitter"] == found["evaluate_emitter"]
    for other in (
        wave_task_bytes(replace(traces, receivers=traces.receivers + 64), width, settings),
        wave_task_bytes(replace(traces, samples=samples + 300), width, settings),
        wave_task_bytes(traces, width + 0.05, settings),
    ):
        assert all(other[name] > size for name, size in found.items())
    more = wave_task_bytes(traces, width, settings.changed(bands=bands + 1))
    assert all(more[name] >= size for name, size in found.items())


@pytest.mark.opencl
def test_the_plan_holds_the_arrays_of_a_device():
    settings = Settings.from_values(method="waveform", nodes=32, bands=2, emitters=5, device="opencl")
    data = scan()
    plan = wave_settings(scale_of(data, settings, data.waveform.object.shape[-1], 1), settings)
    assert plan.engine == "opencl"
    waves = WaveScan(MemorySource(data), plan)
    looks = plan.bands[1].emitters + plan.held_out
    problem = waves.problem(1)
    model = Model(np.full(problem.region.shape, WATER))
    evaluate_emitter(waves, 1, model, 0, looks)
    kept = [array for emitter in problem.used.tolist() for array in problem.observed(emitter, plan.window_s)]
    receivers = place_elements(problem.medium(model.speed), problem.receivers)
    sizes = Scan(receivers, problem.clock.steps, problem.every)
    device = DeviceWaves(session_or_warning(""), problem.medium(model.speed), sizes)
    needed = sum(array.nbytes for array in kept) + device.plan().emitters * device.size.bytes(1)
    told = wave_task_bytes(
        replace(SCAN, emissions=12, receivers=ELEMENTS, samples=120), 2.0 * RADIUS, settings
    )
    assert needed < told["evaluate_emitter"] < 4 * needed + 16 * 2**20
    without = wave_task_bytes(SCAN, 0.1, settings.changed(device="cpu"))
    assert without == wave_task_bytes(SCAN, 0.1, settings.changed(device="auto"))
    assert without["evaluate_emitter"] < wave_task_bytes(SCAN, 0.1, settings)["evaluate_emitter"]


def test_plan_of_waves_covers_every_automatic_choice():
    """It judges by waves where there are traces, and refines where it is given minutes."""
    auto = Settings(method="auto")
    judged = wave_task_bytes(SCAN, 0.1, auto)
    assert list(judged) == ["validate_image"]
    assert wave_task_bytes(SCAN, 0.1, replace(auto, minutes=1e4)) == wave_task_bytes(
        SCAN, 0.1, replace(auto, method="waveform")
    )
    assert wave_tasks(SCAN, 0.1, auto) == 0 < wave_tasks(SCAN, 0.1, replace(auto, minutes=1e4))
    assert wave_task_bytes(None, 0.1, auto) == wave_task_bytes(SCAN, 0.1, Settings(method="sart")) == {}


def test_traces_are_summed_up_with_and_without_a_water_shot(tmp_path):
    write_dataset(tmp_path / "scan.h5", scan())
    found = counts_in(tmp_path / "scan.h5").summary(Settings(method="sart")).traces
    assert found == Traces(12, ELEMENTS, 120, 4, RATE_HZ, CENTRE_HZ, WATER)
    alone = replace(scan().waveform, water=None)
    write_dataset(tmp_path / "alone.h5", replace(scan(), waveform=alone))
    expected = replace(found, water_shot=False)
    assert counts_in(tmp_path / "alone.h5").summary(Settings(method="sart")).traces == expected
