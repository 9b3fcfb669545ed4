"""Foreign volumes: NumPy, raw bytes and our own files are read; hostile files are rejected."""

import io
import zipfile
from contextlib import suppress
from dataclasses import replace

import nibabel
import nrrd
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_workers.files import bounded_reading
from bentray_workers.files.hdf5_reading import Reader
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.files.volume_formats import RAW_TYPES, SPACING_M, VolumeMetadata, import_volume

from ...effort import effort
from .reconstructions import made
from .volumes import ramp, refused


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", ["u1", "<u2", ">u2", "<f8", ">f4"])
def test_numpy(tmp_path, dtype, order):
    values = np.asarray(ramp(dtype=dtype), order=order)
    np.save(tmp_path / "any.name", values)
    volume = import_volume(tmp_path / "any.name.npy")
    np.testing.assert_array_equal(volume.values, values)
    assert volume.spacing_m == (SPACING_M,) * 3


def test_explicit_grid_takes_precedence(tmp_path):
    np.save(tmp_path / "v.npy", ramp())
    volume = import_volume(tmp_path / "v.npy", VolumeMetadata("A head", (2e-3,)))
    assert (volume.title, volume.spacing_m) == ("A head", (2e-3,) * 3)
    assert import_volume(tmp_path / "v.npy", VolumeMetadata(spacing_m=(1e-3, 2e-3, 3e-3))).spacing_m == (
        1e-3,
        2e-3,
        3e-3,
    )


@pytest.mark.parametrize("dtype", RAW_TYPES)
def test_raw_bytes_have_x_first(tmp_path, dtype):
    values = ramp(dtype=RAW_TYPES[dtype])
    (tmp_path / "v").write_bytes(values.tobytes(order="F"))
    volume = import_volume(tmp_path / "v", VolumeMetadata(shape=(3, 4, 5), dtype=dtype, spacing_m=(1e-3,)))
    np.testing.assert_array_equal(volume.values, values)


def test_a_volume_of_ours(tmp_path):
    volume = Volume.from_values(ramp(), (1e-3, 2e-3, 3e-3), (0.0, 1.0, 2.0), "ours")
    write_volume(tmp_path / "v.h5", volume)
    read = import_volume(tmp_path / "v.h5")
    np.testing.assert_array_equal(read.values, volume.values)
    assert (read.spacing_m, read.origin_m, read.title) == (volume.spacing_m, volume.origin_m, volume.title)


def test_a_reconstruction_gives_its_speed(tmp_path):
    result = replace(made(8, 4), spacing_m=(2e-3, 2e-3, 3e-3))
    write_reconstruction(tmp_path / "r.h5", result)
    volume = import_volume(tmp_path / "r.h5")
    np.testing.assert_allclose(volume.values, result.speed, rtol=1e-7)
    assert (volume.spacing_m, volume.origin_m) == (result.spacing_m, result.origin_m)


def test_uneven_slices_and_plain_images_are_rejected(tmp_path):
    write_reconstruction(tmp_path / "r.h5", made(8, 4))
    assert refused(tmp_path / "r.h5").field == "spacing_m"
    write_reconstruction(tmp_path / "r.h5", made(8))
    assert "shape (8, 8)" in refused(tmp_path / "r.h5").value


def saved(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=True)
    return buffer.getvalue()


def header(text: str) -> bytes:
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


HUGE = header("{'descr': '|u1', 'fortran_order': False, 'shape': (65536, 65536, 65536), }\n") + b"\0" * 100


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
@pytest.mark.parametrize("order", ["C", "F"])
def test_the_volume_of_an_archive(tmp_path, save, order):
    values = np.asarray(ramp(dtype="<u2"), order=order)
    save(tmp_path / "v.npz", volume=values, spacing=np.ones(3), note=np.array("a teapot"))
    volume = import_volume(tmp_path / "v.npz", VolumeMetadata(spacing_m=(2e-3,)))
    np.testing.assert_array_equal(volume.values, values)
    assert volume.spacing_m == (2e-3,) * 3


@pytest.mark.parametrize(
    ("members", "field", "found"),
    [
        ({}, "file", "0 arrays with three dimensions (shapes none)"),
        ({"a.txt": b"text"}, "file", "0 arrays"),
        ({"a.npy": saved(np.ones(3))}, "file", "(shapes (3,))"),
        ({"a.npy": saved(ramp()), "b.npy": saved(ramp())}, "file", "2 arrays with three dimensions"),
        ({"a.npy": saved(np.zeros((2, 2, 2), complex))}, "values", "complex"),
        ({"a.npy": saved(np.array([[[{}] * 2] * 2] * 2))}, "values", "Python objects"),
        ({"a.npy": saved(ramp())[:-1]}, "a", "59 bytes of data"),
        ({"a.npy": saved(ramp()) + b"more"}, "file", "more data after the values"),
        ({"a.npy": HUGE}, "values", "281474976710656 bytes"),
        ({"a.npy": b"no array"}, "a", "damaged"),
        ({f"{n}.npy": b"" for n in range(1000)}, "file", "1001 members"),
    ],
)
def test_archives_without_one_volume_are_rejected(tmp_path, members, field, found):
    with zipfile.ZipFile(tmp_path / "v.npz", "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
        # An empty archive begins with the directory.
        archive.writestr("last", b"")
    error = refused(tmp_path / "v.npz")
    assert (error.field, found in error.value) == (field, True), error


def test_a_damaged_archive_is_rejected(tmp_path):
    np.savez_compressed(tmp_path / "v.npz", volume=np.random.default_rng(0).integers(0, 255, (9, 9, 9)))
    content = (tmp_path / "v.npz").read_bytes()
    for damaged in (content[:-40], content[:200] + bytes(50) + content[250:]):
        (tmp_path / "v.npz").write_bytes(damaged)
        assert refused(tmp_path / "v.npz").field in ("file", "volume")


def test_more_than_the_limit_is_rejected_before_it_is_read(tmp_path, monkeypatch):
    np.save(tmp_path / "v.npy", ramp())
    monkeypatch.setattr(bounded_reading, "LARGEST_BYTES", 59)
    error = refused(tmp_path / "v.npy")
    assert "60 bytes" in error.value
    assert "59" in error.accepted


def test_a_shape_without_use_is_rejected_before_the_values_are_read(tmp_path, monkeypatch):
    def nothing_else(shape):
        raise InvalidInput("volume", f"shape {tuple(shape)}", "another")

    def read(*given, **how):
        raise AssertionError("values were read")

    np.save(tmp_path / "v.npy", ramp())
    (tmp_path / "v.raw").write_bytes(ramp().tobytes())
    nrrd.write(str(tmp_path / "v.nrrd"), ramp())
    (tmp_path / "v.nii").write_bytes(nibabel.Nifti1Image(ramp(), np.eye(4)).to_bytes())
    write_volume(tmp_path / "v.h5", Volume.from_values(ramp(), (1e-3,) * 3))
    write_reconstruction(tmp_path / "r.h5", replace(made(3, 5), spacing_m=(2e-3, 2e-3, 3e-3)))
    monkeypatch.setattr(Volume, "from_values", read)
    monkeypatch.setattr(Reader, "array", read)
    for path in sorted(tmp_path.iterdir()):
        given = VolumeMetadata(shape=(3, 4, 5), dtype="uint8") if path.suffix == ".raw" else None
        with pytest.raises(InvalidInput, match=r"volume: found shape \(3, [34], 5\)"):
            import_volume(path, given, nothing_else)


def test_a_spacing_is_for_files_that_have_none(tmp_path):
    write_volume(tmp_path / "v.h5", Volume.from_values(ramp(), (1e-3,) * 3))
    assert refused(tmp_path / "v.h5", VolumeMetadata(spacing_m=(1e-3,))).field == "spacing_m"


@settings(max_examples=effort(20, 150), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_damaged_file_is_read_or_refused_and_nothing_else(tmp_path, data):
    content = bytearray(saved(ramp()))
    for _ in range(data.draw(st.integers(1, 5))):
        content[data.draw(st.integers(0, 127))] = data.draw(st.integers(0, 255))
    (tmp_path / "v").write_bytes(bytes(content[: data.draw(st.integers(0, len(content)))]))
    with suppress(InvalidInput):
        assert import_volume(tmp_path / "v").values.ndim == 3
