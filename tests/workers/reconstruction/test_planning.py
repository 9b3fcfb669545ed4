"""Memory plans: what tasks use; plans larger than any worker are rejected."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.array_shapes import bowl
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.sart.device_slices import SliceSize
from bentray_workers.cluster.capacities import MIB, WorkerCapacity
from bentray_workers.cluster.task_words import task_in_words
from bentray_workers.files.dataset.counts import DatasetCounts, Summary, Traces
from bentray_workers.reconstruction.planning import plan
from bentray_workers.reconstruction.ray_sizes import ray_task_sizes

RING = Summary(256, 256, 256 * 256, 1, False, 0.0, 0.16, 0, True)
BOTH = ("recon", "render")
LARGE, SMALL = WorkerCapacity(8 * 1024 * MIB, BOTH), WorkerCapacity(560 * MIB, BOTH)


def test_rejects_grids_larger_than_worker_memory_with_one_that_fits():
    asked = Settings(nodes=512, method="gauss-newton")
    with pytest.raises(InvalidInput) as refusal:
        plan(RING, asked, [SMALL, SMALL])
    assert refusal.value.field == "nodes"
    assert "bytes" in refusal.value.value
    assert "bytes" in refusal.value.accepted
    fits = int(refusal.value.accepted.split("nodes up to ")[1].split(",")[0])
    assert plan(RING, replace(asked, nodes=fits), [SMALL]).workers == 1
    with pytest.raises(InvalidInput):
        plan(RING, replace(asked, nodes=fits + 1), [SMALL])
    assert plan(RING, asked, [SMALL, LARGE]).workers == 1
    assert plan(RING, asked, []).workers == 0
    assert plan(RING, asked, [WorkerCapacity(0, BOTH)]).workers == 1


@pytest.mark.parametrize(
    ("method", "nodes", "name", "part"),
    [("gauss-newton", 128, "update_gauss_newton", "rays"), ("sart", 512, "update_sart", "images")],
)
def test_refusal_states_what_takes_most_memory(method, nodes, name, part):
    asked = Settings.from_values(method=method, decomposition="volume", nodes=nodes, attenuation=False)
    scan = replace(RING, slices=32, pairs=32 * 256**2, height_m=0.08)
    with pytest.raises(InvalidInput) as refusal:
        plan(scan, asked, [SMALL])
    size = ray_task_sizes(scan, asked)[name]
    said = task_in_words(name)
    found = f"a task ({said}) takes {size.bytes} bytes, {max(size.terms.values())} of them for {part}"
    assert refusal.value.value.endswith(found)


def test_no_limit_is_none():
    assert WorkerCapacity(0, BOTH).task_bytes == math.inf
    assert WorkerCapacity(100 * MIB, BOTH).task_bytes == 0


def test_device_tasks_need_a_worker_with_a_device():
    asked = Settings(method="sart", device="opencl")
    with pytest.raises(InvalidInput, match="device"):
        plan(RING, asked, [LARGE])
    found = plan(RING, asked, [LARGE, WorkerCapacity(0, (*BOTH, "opencl"))])
    assert (found.lane, found.workers) == ("opencl", 1)
    assert "OpenCL" in found.why
    assert plan(RING, replace(asked, device="cpu"), [LARGE]).lane == "recon"
    tracked = Settings(method="sart", eikonal="fim-opencl")
    with pytest.raises(InvalidInput, match="eikonal"):
        plan(RING, tracked, [LARGE])
    assert plan(RING, replace(tracked, rays="straight"), [LARGE]).lane == "recon"


def test_array_in_space_that_is_no_ring_is_planned_as_a_volume():
    array = bowl(40, 0.1)
    every = np.arange(40)
    scan = Dataset(array.position_m, every, every, 1500.0, delta_tof_s=np.zeros((40, 40)), array_type="free")
    settings = Settings.from_values(method="gauss-newton", nodes=48)
    counts = DatasetCounts.from_dataset(scan)
    found = plan(counts.summary(settings), settings, [])
    assert found == plan(counts.summary(settings), settings.changed(decomposition="volume"), [])
    assert found.decomposition == "volume"
    pointed = settings.changed(opening_angle_deg=90.0)
    with pytest.raises(InvalidInput, match="geometry/element_normal"):
        plan(counts.summary(pointed), pointed, [])
    directed = DatasetCounts.from_dataset(replace(scan, element_normal=array.normal))
    assert plan(directed.summary(pointed), pointed, []) == found


@pytest.mark.parametrize(
    ("changes", "decomposition", "words"),
    [
        ({}, "slices", "40 slices in parallel"),
        ({"method": "gauss-newton"}, "emitters", "he 256 emitters"),
        ({"decomposition": "volume"}, "volume", "10240 emitters"),
        ({"method": "auto"}, "emitters", "emitters of each of 40 slices in parallel"),
    ],
)
def test_choice_is_described_in_one_sentence(changes, decomposition, words):
    scan = replace(RING, slices=40, pairs=40 * 256**2, height_m=0.05)
    found = plan(scan, Settings.from_values(**{"method": "sart", **changes}), [WorkerCapacity(0, BOTH)])
    assert found.decomposition == decomposition
    assert words in found.why
    assert found.why.endswith(".")
    assert f"about {found.tasks} tasks" in found.why
    assert json.loads(json.dumps(found.to_dict()))["largest_bytes"] == found.largest[1]


def test_traces_are_planned_for():
    heard = Traces(256, 256, 12_000, 2, 5e7, 2.5e6, 1500.0)
    scan = replace(RING, traces=heard, recorded=heard, traces_bytes=2 * heard.bytes_of(heard.emissions))
    found = plan(scan, Settings(method="sart", nodes=64), [])
    assert {"measure_traces", "examine_slice", "pick_emissions", "finish_slice", "write_picked"} < set(
        found.call_bytes
    )
    assert found.tasks > plan(RING, Settings(method="sart", nodes=64), []).tasks + 2 * 64
    # No call holds more than an emission of what is 3 GiB.
    assert found.largest[1] < scan.traces_bytes / 8
    unseen = plan(scan, Settings.from_values(method="sart", nodes=64, examine=False), [])
    assert "measure_traces" not in unseen.call_bytes
    assert "finish_slice" in plan(replace(RING, period=True), Settings(method="sart"), []).call_bytes
    assert (
        "finish_slice"
        not in plan(
            replace(RING, period=True), Settings.from_values(method="sart", examine=False), []
        ).call_bytes
    )


def test_waves_are_planned_for():
    asked = Settings(method="waveform")
    with pytest.raises(InvalidInput, match="for a scan without traces"):
        plan(RING, asked, [])
    heard = replace(RING, traces=Traces(256, 256, 1000, 2, 1e7, 4e5, 1500.0))
    found = plan(heard, asked, [LARGE])
    assert {"start_band", "evaluate_emitter", "update_image"} < set(found.call_bytes)
    assert found.tasks > plan(heard, replace(asked, method="auto"), [LARGE]).tasks
    with pytest.raises(InvalidInput, match=r"^minutes: "):
        plan(heard, replace(asked, nodes=32), [WorkerCapacity(160 * MIB, BOTH)])
    # ``auto`` judges by waves; in space by times alone.
    tried = replace(asked, method="auto", nodes=32)
    with pytest.raises(InvalidInput, match=r"^method: "):
        plan(heard, tried, [WorkerCapacity(100 * MIB, BOTH)])
    assert "validate_image" not in plan(replace(heard, in_space=True, height_m=0.1), tried, []).call_bytes


@given(
    nodes=st.integers(16, 512),
    method=st.sampled_from(["sart", "gauss-newton"]),
    volume=st.booleans(),
    check=st.booleans(),
)
def test_more_nodes_and_more_slices_never_take_less(nodes, method, volume, check):
    scan = replace(RING, slices=4, pairs=4 * 256**2, height_m=0.01)
    asked = Settings(
        nodes=nodes, method=method, decomposition="volume" if volume else "slices", resolution_check=check
    )
    found = plan(scan, asked, [])
    finer = plan(scan, replace(asked, nodes=nodes + 64), [])
    # The check of times takes the same memory whatever the image.
    for name in ("finish_slice", "write_picked"):
        assert finer.call_bytes.pop(name) == found.call_bytes.pop(name)
    assert all(finer.call_bytes[name] > size for name, size in found.call_bytes.items())
    assert plan(replace(scan, slices=8), asked, []).tasks > found.tasks


def test_a_device_that_cannot_hold_one_slice_or_emitter_is_refused_by_number():
    asked = Settings.from_values(method="sart", nodes=256, device="opencl")
    needed = SliceSize((256, 256), 256, 256, 1, 1).bytes

    def offer(device_bytes):
        return [WorkerCapacity(0, (*BOTH, "opencl"), device_bytes)]

    assert plan(RING, asked, offer(2 * needed)).lane == "opencl"
    assert plan(RING, asked, offer(0)).workers == 1, "its memory is not known"
    with pytest.raises(
        InvalidInput, match=f"nodes: found 256, for which a slice takes {needed} bytes on the device"
    ):
        plan(RING, asked, offer(2 * needed - 2))
    with pytest.raises(InvalidInput, match=f"at most {needed // 4} bytes"):
        plan(RING, asked, offer(needed // 2))
    # Compiled code needs no device.
    assert plan(RING, asked.changed(device="cpu"), offer(1)).lane == "recon"
    waves = replace(RING, traces=Traces(128, 256, 1000, 2, 1e7, 4e5, 1500.0))
    waveform = Settings(method="waveform", device="opencl", nodes=64)
    assert plan(waves, waveform, offer(2**33)).lane == "opencl"
    with pytest.raises(
        InvalidInput, match=r"method: found 'waveform', for which an emitter takes \d+ bytes on"
    ):
        plan(waves, waveform, offer(2**23))
