"""Everything automatic is decided once, before the first task, each with its reason."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings, reconstruct
from bentray_kernels.tomography.scan import MemorySource
from bentray_kernels.tomography.settled import settled

from ..straight_scans import ring_scan
from .waveform.scans import scan as wave_scan

WATER = ring_scan(16, 0.05)
SART = Settings(method="sart", iterations=1)


def stacked(heights):
    """Rings of 16 elements at some heights."""
    position = np.vstack([np.column_stack((WATER.element_position_m, np.full(16, z))) for z in heights])
    every = np.arange(len(position))
    return Dataset(position, every, every, 1500.0, delta_tof_s=np.zeros((len(position),) * 2))


class Cluster:
    """Workers that decide for a device and for blocks."""

    def device(self, size, settings):
        assert (size.emitters, settings.grid_nodes > 0) == (16, True)
        return "opencl", "GPU 9000 was faster in a trial"

    def blocks(self, dataset, settings):
        assert settings.decomposition
        return 3, "since the arrays of the whole volume fit no worker"


@pytest.mark.parametrize(
    ("dataset", "settings", "decided"),
    [
        (
            WATER,
            SART,
            {"decomposition": "slices, since the elements lie", "nodes": "96 along", "water": "1500"},
        ),
        (WATER, replace(SART, nodes=24, decomposition="slices"), {"water": "1500.0 m/s, as the scan"}),
        (
            stacked((0.0, 0.01)),
            SART,
            {"decomposition": "slices, since the elements are stacked", "nodes": ""},
        ),
        (replace(WATER, water_temperature_assumed=True), SART, {"water": "1500.0 m/s, as"}),
        (WATER, SART.changed(method="gauss-newton"), {"uncertainty": "estimated, since it is cheap"}),
    ],
)
def test_what_is_open_is_decided_with_its_reason(dataset, settings, decided):
    found = settled(MemorySource(dataset), settings)
    assert found.settings.nodes is not None
    assert found.settings.decomposition is not None
    assert found.settings.uncertainty == ("uncertainty" in decided)
    assert set(found.reasons) >= set(decided)
    assert all(found.reasons[name].startswith(words) for name, words in decided.items())
    requested = {name for name in ("nodes", "decomposition") if getattr(settings, name) is not None}
    assert not requested & set(found.reasons)
    # Settled settings leave nothing open.
    assert settled(MemorySource(dataset), found.settings).settings == found.settings


def test_machines_decide_device_and_blocks():
    found = settled(MemorySource(WATER), SART, Cluster())
    assert (found.settings.device, found.settings.numerics.blocks) == ("opencl", 3)
    assert found.reasons["device"] == "OpenCL, GPU 9000 was faster in a trial"
    assert found.reasons["blocks"] == "3, since the arrays of the whole volume fit no worker"


@pytest.mark.parametrize(
    ("changes", "allowed", "words"),
    [
        ({"method": "waveform"}, True, None),
        ({"method": "waveform", "minutes": 0.05}, True, "the most within 0.05 minutes"),
        ({"method": "auto"}, False, None),
        ({"method": "auto", "minutes": 1e5}, True, "5 of 32 emitters, the most within 100000 minutes"),
        ({"method": "auto", "minutes": 0.0}, False, None),
    ],
)
def test_the_budget_decides_bands_and_emitters(changes, allowed, words):
    settings = Settings.from_values(nodes=24, **changes)
    found = settled(MemorySource(wave_scan()), settings)
    assert found.waves.allowed == allowed
    # The rays before a refinement keep what was requested.
    assert found.settings.numerics == settings.numerics
    assert words in found.reasons["bands"] if words else "bands" not in found.reasons
    assert settled(MemorySource(wave_scan()), Settings(method="sart")).waves is None


def test_what_does_not_fit_the_scan_is_rejected():
    with pytest.raises(InvalidInput, match="decomposition"):
        settled(MemorySource(WATER), replace(SART, decomposition="volume"))
    with pytest.raises(InvalidInput, match="method"):
        settled(MemorySource(WATER), Settings(method="waveform"))


def test_the_result_states_what_was_decided():
    result = reconstruct(WATER, replace(SART, method="gauss-newton"))
    said = result.provenance["automatic"]
    assert said.startswith("water: 1500.0 m/s, as the scan states it; decomposition: slices, since")
    assert "eikonal: accurate in place of deviation, since rays are traced one by one" in said
    fixed = reconstruct(WATER, replace(SART, nodes=24, decomposition="slices", rays="straight"))
    assert fixed.provenance["automatic"] == "water: 1500.0 m/s, as the scan states it"
