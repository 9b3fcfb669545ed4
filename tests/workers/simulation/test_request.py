"""Requests of simulations: the same scan from the stored request, and rejected ones."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import DETAILED_SIDE_M
from bentray_workers.simulation.plane import SimulationSettings, plane_phantom
from bentray_workers.simulation.request import SAMPLE, PhantomScan
from bentray_workers.simulation.volume import VolumeSimulationSettings
from bentray_workers.simulation.volume_waves import VolumeWaveSettings
from bentray_workers.simulation.waves import BreastWaveSettings, VerticalWaveSettings, WaveSimulationSettings

SIZES = {"nodes": st.integers(16, 1024), "elements": st.integers(8, 4096), "seed": st.integers(0, 2**40)}
NOISE = {"snr": st.none() | st.floats(0.1, 1e6), "coupling_mps": st.floats(1300.0, 1700.0)}
TIMES = {"refinement": st.none() | st.integers(4, 64), "attenuation": st.none() | st.booleans()}


@given(
    st.fixed_dictionaries(SIZES | NOISE | TIMES)
    | st.fixed_dictionaries(
        SIZES
        | NOISE
        | TIMES
        | {"phantom": st.just("table7"), "slices": st.none() | st.integers(2, 9), "three_d": st.booleans()}
    )
    | st.fixed_dictionaries(
        SIZES
        | NOISE
        | {"waveform": st.just(True), "frequency_hz": st.floats(1e4, 1e6), "emissions": st.just(8)}
    )
)
def test_stored_request_gives_the_same_scan(given):
    # A seed is that of the noise.
    given |= {"seed": given["seed"] if given["snr"] else 0}
    asked = PhantomScan(**given)
    stored = json.loads(json.dumps(asked.plain()))
    assert PhantomScan(**stored).chosen() == asked.chosen()
    for name, value in given.items():
        if name not in ("phantom", "waveform") and value is not None:
            assert getattr(asked.chosen(), name) == value


def test_request_selects_the_phantom():
    assert PhantomScan().chosen() == SimulationSettings()
    assert PhantomScan(phantom="table7").chosen() == VolumeSimulationSettings()
    waves = PhantomScan(waveform=True, nodes=256, elements=128).chosen()
    assert waves == WaveSimulationSettings()
    upright = PhantomScan(phantom="table6-vertical", waveform=True, nodes=256, elements=128).chosen()
    assert upright == VerticalWaveSettings() != waves
    assert PhantomScan(phantom="table6-vertical").chosen() == SimulationSettings(phantom="table6-vertical")
    in_space = PhantomScan(phantom="table7", waveform=True, nodes=256, elements=128).chosen()
    assert in_space == VolumeWaveSettings()


@pytest.mark.parametrize(
    ("kind", "changes", "field"),
    [
        (SimulationSettings, {"snr": 10.0, "noise_s": 1e-8}, "snr"),
        (VolumeSimulationSettings, {"refinement": 2}, "refinement"),
        (VolumeSimulationSettings, {"array": "rings"}, "array"),
        (VolumeSimulationSettings, {"array": "spiral"}, "array"),
        (WaveSimulationSettings, {"frequency_hz": 9e6, "side_m": 1.0}, "frequency_hz"),
        (WaveSimulationSettings, {"emissions": 200}, "emissions"),
        (VolumeWaveSettings, {"frequency_hz": 2e6}, "frequency_hz"),
        (VolumeWaveSettings, {"frequency_hz": 3e5, "side_m": 0.6}, "frequency_hz"),
    ],
)
def test_settings_that_do_not_go_together_are_refused(kind, changes, field):
    with pytest.raises(InvalidInput, match=f"^{field}: "):
        kind(**changes)


@pytest.mark.parametrize("phantom", ["detailed", "breast"])
def test_waves_cross_a_breast_with_texture_scaled_to_the_side(phantom):
    waves = PhantomScan(phantom=phantom, waveform=True, side_m=0.06, frequency_hz=3e5).chosen()
    breast = plane_phantom(phantom, 1500.0)
    np.testing.assert_array_equal(waves.speed(), breast.speed(waves.fine_nodes, DETAILED_SIDE_M))
    low, high = waves.speeds
    assert low <= waves.speed().min() < 1460.0 < 1560.0 < waves.speed().max() <= high


def test_the_sample_is_a_request_of_traces():
    waves = PhantomScan(**json.loads(json.dumps(dict(SAMPLE)))).chosen()
    assert isinstance(waves, BreastWaveSettings)
    assert waves.emissions == SAMPLE["emissions"] < waves.elements


def test_every_element_of_a_small_ring_emits():
    assert PhantomScan(waveform=True, elements=32).chosen().emissions == 32
    assert PhantomScan(waveform=True, elements=96).chosen().emissions == 64
