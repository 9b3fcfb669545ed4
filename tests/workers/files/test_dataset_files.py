"""Dataset files: round trip, and errors that name each invalid field."""

import tempfile
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bentray_kernels.acquisition import Dataset
from bentray_kernels.errors import InvalidInput
from bentray_workers.files.dataset import copy_dataset, read_dataset, write_dataset

from ...effort import effort
from .datasets import datasets, small

DATA = Path(__file__).parents[4] / "shared" / "data"


def assert_same(a, b, name="dataset"):
    if is_dataclass(a):
        assert type(a) is type(b), name
        for f in fields(a):
            assert_same(getattr(a, f.name), getattr(b, f.name), f"{name}.{f.name}")
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, name
        np.testing.assert_array_equal(a, b, err_msg=name)
    else:
        assert a == b, name


@given(datasets())
@settings(max_examples=effort(20, 40), deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_written_file_round_trips(dataset):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "d.h5"
        write_dataset(path, dataset)
        assert_same(read_dataset(path), dataset)


def test_the_same_dataset_gives_the_same_bytes(tmp_path):
    write_dataset(tmp_path / "a.h5", small())
    write_dataset(tmp_path / "b.h5", read_dataset(tmp_path / "a.h5"))
    # Only the temperature, which follows from the speed, was added on reading.
    write_dataset(tmp_path / "c.h5", read_dataset(tmp_path / "b.h5"))
    assert (tmp_path / "b.h5").read_bytes() == (tmp_path / "c.h5").read_bytes()


def test_traces_stay_in_the_file_when_not_requested(tmp_path):
    write_dataset(tmp_path / "d.h5", small())
    assert read_dataset(tmp_path / "d.h5", traces=False).waveform is None
    write_dataset(tmp_path / "raw.h5", replace(small(), delta_tof_s=None))
    raw = read_dataset(tmp_path / "raw.h5", traces=False)
    assert raw.waveform is None
    assert not raw.picked
    assert raw.truth is not None
    with pytest.raises(InvalidInput, match="traveltime"):
        write_dataset(tmp_path / "nothing.h5", raw)
    assert not (tmp_path / "nothing.h5").exists()


def test_temperature_and_speed_follow_from_each_other(tmp_path):
    path = tmp_path / "d.h5"
    write_dataset(path, replace(small(), water_speed_mps=1482.38))
    assert read_dataset(path).water_temperature_c == pytest.approx(20.0, abs=0.01)
    with h5py.File(path, "a") as file:
        del file["water"].attrs["sound_speed_mps"]
        file["water"].attrs["temperature_c"] = 37.0
    assert read_dataset(path).water_speed_mps == pytest.approx(1523.65, abs=0.05)
    write_dataset(path, replace(small(), water_speed_mps=1375.0))
    assert read_dataset(path).water_temperature_c is None


def put(path, name, data):
    def change(file):
        if name in file:
            del file[name]
        if data is not None:
            file.create_dataset(name, data=data)

    return (path, change)


def attr(owner, name, value):
    def change(file):
        file[owner].attrs.pop(name, None)
        if value is not None:
            file[owner].attrs[name] = value

    return (f"{owner.strip('/')}@{name}", change)


def array(name, data):
    return put(name, name, data)


nan_position = small().element_position_m.copy()
nan_position[5, 1] = np.nan
inf_delta = small().delta_tof_s.copy()
inf_delta[1, 2] = np.inf

WRONG = {
    "no format": attr("/", "format", None),
    "version is a number": attr("/", "format_version", 1.0),
    "dimension is text": attr("/", "dimension", "two"),
    "positions are text": array("geometry/element_position_m", ["a", "b", "c"]),
    "positions are flat": array("geometry/element_position_m", np.zeros(6)),
    "radius": attr("geometry", "radius_m", -1.0),
    "normals": array("geometry/element_normal", np.ones((2, 2))),
    "tx out of range": array("acquisition/tx", np.arange(20, 32)),
    "rx empty": array("acquisition/rx", np.empty(0, dtype=np.int64)),
    "no sampling rate": attr("acquisition", "sampling_rate_hz", None),
    "sampling rate is a list": attr("acquisition", "sampling_rate_hz", [1.0, 2.0]),
    "sampling rate is text": attr("acquisition", "sampling_rate_hz", "1 MHz"),
    "centre frequency": attr("acquisition", "center_frequency_hz", np.nan),
    "wavelet": array("acquisition/wavelet", np.zeros((2, 2))),
    "water stands still": attr("water", "sound_speed_mps", 0.0),
    "sigma negative": array("traveltime/sigma_s", np.full((12, 24), -1e-9)),
    "valid is real": array("mask/valid", np.ones((12, 24))),
    "traces shape": (
        "waveform/object",
        lambda f: [
            array(f"waveform/{n}", np.zeros((12, 12, 20), np.int16))[1](f) for n in ("object", "water")
        ],
    ),
    "scale": attr("waveform", "scale", 0.0),
    "trace scale": array("waveform/object_scale", np.ones(12)),
    "slices fall": array("slice/z_m", [1.0, 0.0]),
    "truth speed": array("truth/sound_speed_mps", np.full((32, 32), -1.0)),
    "truth spacing": attr("truth", "spacing_m", None),
    "truth origin": attr("truth", "origin_m", [np.nan, 0.0]),
    "truth attenuation": array("truth/attenuation_np_m", np.zeros((3, 3))),
    "a group where an array should be": (
        "traveltime/delta_tof_s",
        lambda f: (f.pop("traveltime/delta_tof_s"), f.create_group("traveltime/delta_tof_s")),
    ),
    "an array where a group should be": (
        "geometry",
        lambda f: (f.pop("geometry"), f.create_dataset("geometry", data=1.0)),
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_errors_name_field_value_and_accepted_values(tmp_path, case):
    field, change = WRONG[case]
    path = tmp_path / "d.h5"
    write_dataset(path, small())
    with h5py.File(path, "a") as file:
        change(file)
    for read in (read_dataset, lambda path: copy_dataset(path, tmp_path / "copy.h5")):
        with pytest.raises(InvalidInput, match=f"^{field}: found .+; accepted: .+"):
            read(path)
    assert not (tmp_path / "copy.h5").exists()


def test_a_file_without_travel_times_and_traces_is_rejected(tmp_path):
    write_dataset(tmp_path / "d.h5", small())
    with h5py.File(tmp_path / "d.h5", "a") as file:
        del file["traveltime"], file["waveform"]
    for traces in (True, False):
        with pytest.raises(InvalidInput, match=r"^traveltime: found neither"):
            read_dataset(tmp_path / "d.h5", traces=traces)


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"", "an empty file"),
        (b"PK\x03\x04 a zip", "not HDF5"),
        (b"\x89HDF\r\n\x1a\n", "cut short or damaged"),
    ],
)
def test_rejects_files_that_are_no_hdf5(tmp_path, content, found):
    (tmp_path / "d.h5").write_bytes(content)
    with pytest.raises(InvalidInput, match=f"^file: found .*{found}"):
        read_dataset(tmp_path / "d.h5")
    with pytest.raises(InvalidInput, match="No such file"):
        read_dataset(tmp_path / "absent.h5")


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> bytes:
    path = tmp_path_factory.mktemp("whole") / "d.h5"
    write_dataset(path, small())
    return path.read_bytes()


def read_bytes(content: bytes) -> Dataset | None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "d.h5"
        path.write_bytes(content)
        try:
            return read_dataset(path)
        except InvalidInput:
            return None


def test_a_file_cut_short_anywhere_is_rejected(whole):
    for length in range(0, len(whole), max(1, len(whole) // 150)):
        assert read_bytes(whole[:length]) is None


@given(
    flips=st.lists(
        st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(1, 255)), min_size=1, max_size=4
    )
)
@settings(
    max_examples=effort(20, 200), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_flipped_bits_give_a_refusal_or_a_dataset_that_holds_its_rules(whole, flips):
    content = bytearray(whole)
    for place, mask in flips:
        content[int(place * len(content))] ^= mask
    result = read_bytes(bytes(content))
    assert result is None or result.picked or result.waveform is not None


@pytest.mark.real
@pytest.mark.parametrize("name", ["openust_measured.h5", "ring_wave_a.h5"])
def test_real_files_are_read_and_come_back(tmp_path, name):
    if not (DATA / name).exists():
        pytest.skip(f"NOT CHECKED: {DATA / name} is absent")
    dataset = read_dataset(DATA / name)
    write_dataset(tmp_path / "copy.h5", dataset)
    assert_same(read_dataset(tmp_path / "copy.h5"), dataset)
