"""The device of a job: decided once by the benchmark, kept on a resume, and none where no engine exists."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import Device, device_selection, engine_selection
from bentray_kernels.tomography import Settings, device_choice
from bentray_kernels.tomography.device_choice import ScanSize, choose_device, device_work
from bentray_workers.cluster import capacities
from bentray_workers.cluster.connection import open_cluster
from bentray_workers.reconstruction.job_machine import DECISIONS, JobMachine

GPU = Device(0, "Fast Platform", "GPU 9000", "gpu", "OpenCL 3.0", "1.2.3", True)
SIZE = ScanSize(40, 256, 256, 0)
SART = Settings(method="sart", nodes=32, decomposition="slices")


@pytest.fixture
def trial(monkeypatch):
    """Decision of the benchmark, and how often it is asked."""
    asked, answer = [], [SimpleNamespace(device=GPU)]

    def place(work, device="auto"):
        asked.append(work)
        return answer[0]

    monkeypatch.setattr(device_choice, "select_engine", place)
    monkeypatch.setattr(device_choice, "may_select_device", lambda: True)
    monkeypatch.delenv("BENTRAY_DEVICE", raising=False)
    return asked, answer


def test_auto_takes_the_device_where_the_trial_was_faster(trial):
    asked, answer = trial
    assert choose_device(SIZE, SART)[0] == "opencl"
    answer[0] = None
    assert choose_device(SIZE, SART) == ("auto", "no OpenCL device of this machine was faster in a trial")
    assert {work.engine for work in asked} == {"sart"}
    assert asked[0].size == 8 * 40 * 32**2
    assert asked[0].memory_bytes > asked[0].buffer_bytes > 0
    assert choose_device(SIZE, SART.changed(device="cpu"))[0] == "cpu"
    assert len(asked) == 2


def test_auto_leaves_the_processor_to_compiled_tasks(trial, monkeypatch):
    _, answer = trial
    answer[0] = SimpleNamespace(device=replace(GPU, kind="cpu"))
    assert choose_device(SIZE, SART)[0] == "auto"
    monkeypatch.setenv("BENTRAY_DEVICE", "opencl")
    assert choose_device(SIZE, SART)[0] == "opencl"


@pytest.mark.parametrize(
    ("changes", "samples", "engine"),
    [
        ({}, 0, "sart"),
        ({"rays": "straight"}, 0, "sart"),
        ({"method": "gauss-newton"}, 0, None),
        ({"method": "auto"}, 0, "sart"),
        ({"method": "auto"}, 100, "sart"),
        ({"method": "auto", "minutes": 5.0}, 100, "wave"),
        ({"method": "waveform"}, 100, "wave"),
        ({"method": "waveform", "reflection": True}, 100, "wave"),
        ({"method": "gauss-newton", "reflection": True}, 100, "reflection"),
        ({"decomposition": "volume"}, 0, None),
        ({"eikonal": "fmm"}, 0, None),
        ({"speed_range_mps": (1400.0, 1600.0)}, 0, None),
    ],
)
def test_the_part_that_takes_longest_decides(changes, samples, engine):
    work = device_work(SIZE._replace(samples=samples), SART.changed(**changes))
    assert (work.engine if work else None) == engine


def test_a_resumed_job_keeps_its_device(trial, tmp_path):
    asked, answer = trial
    assert JobMachine(None, tmp_path).device(SIZE, SART)[0] == "opencl"
    answer[0] = None
    assert JobMachine(None, tmp_path).device(SIZE, SART)[0] == "opencl"
    assert len(asked) == 1
    (tmp_path / DECISIONS).write_text("damaged")
    assert JobMachine(None, tmp_path).device(SIZE, SART)[0] == "auto"


def test_embedded_workers_offer_the_device_that_is_chosen(trial, tmp_path, monkeypatch):
    monkeypatch.setattr(capacities, "_has_device", lambda: True)
    with open_cluster(workers=1, local_directory=tmp_path / "local", processes=False) as cluster:
        assert JobMachine(cluster.client, tmp_path).device(SIZE, SART)[0] == "opencl"
        assert "opencl" in capacities.capacities_of(cluster.client)[0].resources
        # A device that has gone since is not waited for.
        monkeypatch.setattr(capacities, "_has_device", lambda: False)
    with open_cluster(workers=1, local_directory=tmp_path / "other", processes=False) as cluster:
        assert JobMachine(cluster.client, tmp_path).device(SIZE, SART)[0] == "auto"


def test_without_a_device_nothing_is_decided_or_written(tmp_path, monkeypatch):
    monkeypatch.setenv("BENTRAY_DEVICE", "cpu")
    assert JobMachine(None, tmp_path).device(SIZE, SART) == ("auto", "")
    assert not (tmp_path / DECISIONS).exists()


def test_a_requested_device_that_is_missing_is_an_error(tmp_path, monkeypatch):
    monkeypatch.delenv("BENTRAY_DEVICE", raising=False)
    monkeypatch.setenv("BENTRAY_OPENCL_DEVICE", "none")
    with pytest.raises(InvalidInput, match="device: found 'opencl', but BENTRAY_OPENCL_DEVICE=none"):
        JobMachine(None, tmp_path).device(SIZE, SART.changed(device="opencl"))
    monkeypatch.setenv("BENTRAY_DEVICE", "cpu")
    with pytest.raises(InvalidInput, match="because this machine has BENTRAY_DEVICE=cpu"):
        JobMachine(None, tmp_path).device(SIZE, SART.changed(device="opencl"))
    assert device_selection.hidden()
    assert not engine_selection.may_select_device()
