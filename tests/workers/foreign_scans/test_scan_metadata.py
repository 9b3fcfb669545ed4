"""Own names of variables, units, temperature and frequency that the user states for a foreign scan."""

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from bentray_kernels.acquisition import speed_from_temperature
from bentray_kernels.errors import InvalidInput
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.foreign_scans import ScanMetadata, convert_dataset

from .hdf5_scans import write_fields, zea_fields
from .scans import (
    ELEMENTS,
    RATE_HZ,
    SAMPLES,
    T0_S,
    delta_tof,
    positions,
    traces,
    travel_times,
    waveforms,
    write_matlab73,
)

OWN = {"map": ("element_position=pos", "delta_tof=dtof"), "unit": ("mm", "us")}


def own_variables() -> dict[str, np.ndarray]:
    """In mm and µs, the positions with the coordinates along the first axis."""
    return {"pos": 1e3 * positions().T, "dtof": 1e6 * delta_tof(), "other": np.zeros((2, 2))}


def python_hdf5(path, variables):
    write_fields(path, {f"scan/{name}": array for name, array in variables.items()})


def archive(path, variables):
    with path.open("wb") as file:
        np.savez(file, **variables)


def converted(tmp_path, **given):
    convert_dataset(tmp_path / "scan", tmp_path / "canonical.h5", given=ScanMetadata.from_options(**given))
    return read_dataset(tmp_path / "canonical.h5")


@pytest.mark.parametrize(
    ("write", "group"), [(savemat, ""), (write_matlab73, ""), (archive, ""), (python_hdf5, "scan/")]
)
def test_own_variables_are_converted_with_their_units(tmp_path, write, group):
    write(tmp_path / "scan", own_variables(), **({"appendmat": False} if write is savemat else {}))
    names = (f"element_position={group}pos", f"delta_tof_s={group}dtof")
    dataset = converted(tmp_path, map=names, unit=("mm", "us"), temperature_c=24.0, frequency_hz=1e6)
    np.testing.assert_allclose(dataset.element_position_m, positions())
    np.testing.assert_allclose(dataset.delta_tof_s, delta_tof())
    assert dataset.tx.tolist() == dataset.rx.tolist() == list(range(ELEMENTS))
    assert dataset.water_speed_mps == pytest.approx(speed_from_temperature(24.0))
    assert dataset.center_frequency_hz == 1e6
    assert not dataset.water_temperature_assumed


def test_own_traces_with_a_time_axis_and_indices_of_matlab(tmp_path):
    """MATLAB counts elements from 1, in doubles."""
    time = 1e6 * (T0_S + np.arange(SAMPLES) / RATE_HZ)
    emitters = np.array([3.0, 8.0])
    own = {"p": positions(), "rf": traces()[:, :, :2], "t": time, "e": emitters, "f": 4e5}
    savemat(tmp_path / "scan", own, appendmat=False)
    names = ("element_position=p", "object=rf", "time=t", "tx=e", "center_frequency=f")
    dataset = converted(tmp_path, map=names, unit=["µs"])
    assert dataset.tx.tolist() == [2, 7]
    assert dataset.sampling_rate_hz == pytest.approx(RATE_HZ)
    assert dataset.t0_s == pytest.approx(T0_S)
    assert dataset.center_frequency_hz == 4e5
    np.testing.assert_array_equal(dataset.waveform.object, traces()[:, :, :2].T.astype(np.float32))
    assert dataset.water_temperature_assumed


def test_units_and_water_are_stated_for_known_formats_too(tmp_path):
    own = travel_times() | {"element_positions": 1e2 * positions(), "sound_speed_mps": 1490.0}
    savemat(tmp_path / "scan", own, appendmat=False)
    dataset = converted(tmp_path, unit=["cm"], sound_speed_mps=1485.0)
    np.testing.assert_allclose(dataset.element_position_m, positions())
    assert dataset.water_speed_mps == 1485.0
    write_fields(tmp_path / "scan", zea_fields(**{"scan/sound_speed": None}))
    assert converted(tmp_path, temperature_c=30.0).water_temperature_c == 30.0


def test_the_unit_is_proposed(tmp_path):
    own = waveforms() | {"transducerPositionsXY": 1e3 * positions().T}
    savemat(tmp_path / "scan", own, appendmat=False)
    with pytest.raises(
        InvalidInput, match="these positions look like mm: write m, or state the unit: --unit mm"
    ):
        converted(tmp_path)
    assert converted(tmp_path, unit=["mm"]).waveform is not None


def test_an_assumed_temperature_is_recorded(tmp_path):
    savemat(tmp_path / "scan", travel_times(), appendmat=False)
    assert converted(tmp_path).water_temperature_assumed
    write_dataset(tmp_path / "again.h5", read_dataset(tmp_path / "canonical.h5"))
    assert read_dataset(tmp_path / "again.h5").water_temperature_assumed


@pytest.mark.parametrize(
    ("given", "field", "accepted"),
    [
        ({"map": ["pos"]}, "map", "FIELD=VARIABLE with a field of element_position"),
        ({"map": ["speed=c"]}, "map", "element_position"),
        ({"map": ["tx=a", "tx=b"]}, "map", "one variable for tx"),
        ({"map": ["element_position=a\0b"]}, "map", "FIELD=VARIABLE"),
        ({"unit": ["inch"]}, "unit", "one of m, s"),
        ({"unit": ["mm", "cm"]}, "unit", "one unit of length"),
        ({"temperature_c": 1e3}, "temperature", "150"),
        ({"frequency_hz": float("nan")}, "frequency", "Hz"),
        ({"map": ("element_position=nowhere", "delta_tof=dtof")}, "map element_position", "one of dtof"),
        ({"map": ("element_position=other", "delta_tof=dtof")}, "elements of other", "3 to"),
        ({"map": ("element_position=pos",)}, "traveltime", "delta_tof_s"),
        ({"map": ("delta_tof=dtof",)}, "file", "--map element_position=NAME"),
        ({**OWN, "sound_speed_mps": 1.0}, "sound speed", "200"),
    ],
)
def test_names_unusable_values(tmp_path, given, field, accepted):
    savemat(tmp_path / "scan", own_variables(), appendmat=False)
    with pytest.raises(InvalidInput, match=rf"^{field}: .*; accepted: .*{accepted}"):
        converted(tmp_path, **given)


def test_water_that_contradicts_the_file_is_rejected(tmp_path):
    savemat(tmp_path / "scan", travel_times() | {"sound_speed_mps": 1540.0}, appendmat=False)
    with pytest.raises(InvalidInput, match=r"temperature: found 1482\.4 m/s in the water, while sound_speed"):
        converted(tmp_path, temperature_c=20.0)


def test_files_in_the_upload_format_state_everything_themselves(tmp_path):
    savemat(tmp_path / "scan", travel_times(), appendmat=False)
    converted(tmp_path)
    given = ScanMetadata.from_options(unit=["mm"], temperature_c=21.0)
    with pytest.raises(InvalidInput, match="files in the upload format state their units") as refused:
        convert_dataset(tmp_path / "canonical.h5", tmp_path / "again.h5", given=given)
    assert refused.value.field == "unit, temperature"
    assert "--water-temperature" in refused.value.accepted


def test_links_out_of_the_file_are_not_followed(tmp_path):
    with h5py.File(tmp_path / "scan", "w") as file:
        file["pos"], file["dtof"] = h5py.ExternalLink("other.h5", "pos"), h5py.SoftLink("/pos")
    with pytest.raises(InvalidInput, match="a soft or external link"):
        converted(tmp_path, **OWN)
