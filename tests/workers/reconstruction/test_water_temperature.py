"""The setting water_temperature_c: the same result as a file that states it, and the file stays as it is."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import speed_from_temperature
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.requirements import check_scan
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.dataset.read import read_dataset
from bentray_workers.reconstruction.reconstruction_run import reconstruct

from ...kernels.acquisition.reference.object_scans import ELEMENTS, disc_delay_s, without_water
from ...kernels.acquisition.traces import RADIUS_M, scan

STATED_C = 20.4
SETTINGS = Settings.from_values(method="sart", nodes=16, iterations=1, water_temperature_c=STATED_C)


def times():
    """Absolute times, of which the water speed is subtracted."""
    data = scan(disc_delay_s(0.5 * RADIUS_M), elements=ELEMENTS)
    straight = data.distance_m() / data.water_speed_mps
    return replace(data, waveform=None, tof_s=straight - 0.01 * straight, sampling_rate_hz=None)


SCANS = {
    "travel times": times,
    "water shot": lambda: scan(disc_delay_s(0.5 * RADIUS_M), elements=ELEMENTS, noise=0.02),
    "no water shot": lambda: without_water(scan(disc_delay_s(0.5 * RADIUS_M), elements=ELEMENTS, noise=0.02)),
}


@pytest.mark.parametrize(
    "which",
    ["travel times", *(pytest.param(f"{one}water shot", marks=pytest.mark.nightly) for one in ("", "no "))],
)
@pytest.mark.parametrize("assumed", [pytest.param(False, marks=pytest.mark.nightly), True])
def test_the_result_is_that_of_a_file_that_states_it(tmp_path, which, assumed):
    data = SCANS[which]()
    # 16.0 °C, too cold for the chords by 13 m/s.
    wrong = replace(data.in_water_of(16.0), water_temperature_assumed=assumed)
    recorded, right = tmp_path / "recorded.h5", tmp_path / "right.h5"
    write_dataset(recorded, wrong)
    write_dataset(right, data.in_water_of(STATED_C))
    before = recorded.read_bytes()
    result = reconstruct(None, recorded, SETTINGS)
    expected = reconstruct(None, right, SETTINGS.changed(water_temperature_c=None))
    assert result.water_speed_mps == expected.water_speed_mps == speed_from_temperature(STATED_C)
    np.testing.assert_array_equal(result.speed, expected.speed)
    assert recorded.read_bytes() == before
    assert result.settings.water_temperature_c == STATED_C
    said = result.provenance["water"]
    assert said.startswith("Water of 1483.6 m/s (20.4 °C), by the setting water_temperature_c. In the scan: ")
    assert ("16.0 °C is assumed" in said) is assumed
    other = reconstruct(None, recorded, SETTINGS.changed(water_temperature_c=None))
    # An assumed speed is fitted to the chords, where there are traces.
    least = 0.1 if assumed else 5.0
    assert np.abs(other.speed - result.speed).max() > least


def test_the_bounds_of_the_image_contain_the_stated_water():
    data = times().in_water_of(20.0)
    settings = SETTINGS.changed(speed_bounds_mps=(1400.0, 1500.0))
    check_scan(data, settings, 0)
    with pytest.raises(InvalidInput, match="around the speed of the water, 1509"):
        check_scan(data, settings.changed(water_temperature_c=30.0), 0)


@pytest.mark.parametrize("wrong", [-0.1, 95.1, float("nan")])
def test_a_temperature_without_a_speed_is_rejected(wrong):
    with pytest.raises(InvalidInput, match=r"water_temperature_c: found .*; accepted: .*0 to 95 °C"):
        Settings(water_temperature_c=wrong)


def test_none_is_the_water_of_the_scan(tmp_path):
    data = times()
    assert data.in_water_of(None) is data
    write_dataset(tmp_path / "scan.h5", data.in_water_of(STATED_C))
    assert read_dataset(tmp_path / "scan.h5").water_temperature_c == STATED_C
