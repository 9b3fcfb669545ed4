"""NIfTI: values, scale and units come out as they went in, packed or not; damage is refused."""

import gzip
from contextlib import suppress

import nibabel
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_workers.volume_reading import import_volume

from .volumes import ramp, refused

AFFINE = np.array([[2.0, 0, 0, 10], [0, 3, 0, 20], [0, 0, 4, 30], [0, 0, 0, 1]])


def image(values=None, kind=nibabel.Nifti1Image, unit="mm"):
    made = kind(ramp(dtype=np.int16) if values is None else values, AFFINE)
    made.header.set_xyzt_units(unit)
    return made


@pytest.mark.parametrize("kind", [nibabel.Nifti1Image, nibabel.Nifti2Image])
@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32, np.float64])
def test_a_file_of_nibabel(tmp_path, kind, packed, dtype):
    content = image(ramp(dtype=dtype), kind).to_bytes()
    (tmp_path / "v").write_bytes(gzip.compress(content) if packed else content)
    volume = import_volume(tmp_path / "v")
    np.testing.assert_array_equal(volume.values, ramp(dtype=dtype))
    np.testing.assert_allclose(volume.spacing_m, (2e-3, 3e-3, 4e-3))
    np.testing.assert_allclose(volume.origin_m, (1e-2, 2e-2, 3e-2))


@pytest.mark.parametrize(("unit", "metre"), [("meter", 1.0), ("mm", 1e-3), ("micron", 1e-6), (0, 1e-3)])
def test_units(tmp_path, unit, metre):
    (tmp_path / "v").write_bytes(image(unit=unit).to_bytes())
    np.testing.assert_allclose(import_volume(tmp_path / "v").spacing_m, (2 * metre, 3 * metre, 4 * metre))


def test_scaled_values(tmp_path):
    values = np.linspace(-1.0, 3.0, 60).reshape(3, 4, 5)
    scaled = image(values)
    scaled.header.set_data_dtype(np.int16)
    (tmp_path / "v").write_bytes(scaled.to_bytes())
    np.testing.assert_allclose(import_volume(tmp_path / "v").values, values, atol=1e-4)


def test_a_fourth_axis_of_one_moment(tmp_path):
    (tmp_path / "v").write_bytes(image(ramp()[..., None]).to_bytes())
    assert import_volume(tmp_path / "v").values.shape == (3, 4, 5)


def spoilt(name, value):
    content = image()
    raw = bytearray(content.to_bytes())
    header = content.header.copy()
    header["vox_offset"] = 352
    header["magic"] = b"n+1"
    header[name] = value
    raw[:348] = header.binaryblock
    return bytes(raw)


@pytest.mark.parametrize(
    ("content", "field"),
    [
        (image(np.zeros((2, 2, 2, 3), np.float32)).to_bytes(), "dim"),
        (image(np.zeros((2, 2, 2), np.complex64)).to_bytes(), "dim"),
        (image(np.zeros((2, 2, 2), [("R", "u1"), ("G", "u1"), ("B", "u1")])).to_bytes(), "dim"),
        (image(np.full((2, 2, 2), np.nan, np.float32)).to_bytes(), "values"),
        (image().to_bytes()[:-1], "file"),
        (image().to_bytes()[:348], "file"),
        (spoilt("dim", [3, 32767, 32767, 32767, 1, 1, 1, 1]), "dim"),
        (spoilt("dim", [3, -3, -4, 5, 1, 1, 1, 1]), "dim"),
        (spoilt("vox_offset", 3e9), "vox_offset"),
        (spoilt("datatype", 1234), "file"),
        (spoilt("srow_x", [np.nan, 0, 0, 0]), "spacing_m"),
        (spoilt("srow_x", [2, 0, 0, np.inf]), "origin_m"),
        (gzip.compress(image().to_bytes())[:60], "file"),
        (gzip.compress(b"no volume at all" * 100), "file"),
        (gzip.compress(b"\0" * 100_000_000), "file"),
    ],
)
def test_what_is_refused(tmp_path, content, field, capfd, caplog):
    (tmp_path / "v").write_bytes(content)
    error = refused(tmp_path / "v")
    assert error.field == field, error
    assert (caplog.text, *capfd.readouterr()) == ("", "", "")


def test_a_bomb_gives_what_was_declared_and_no_more(tmp_path):
    (tmp_path / "v").write_bytes(gzip.compress(image().to_bytes() + b"\0" * 200_000_000, 9))
    np.testing.assert_array_equal(import_volume(tmp_path / "v").values, ramp(dtype=np.int16))


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.dictionaries(st.integers(0, 347), st.integers(0, 255), min_size=1, max_size=6))
def test_a_damaged_header_is_read_or_refused_and_nothing_else(tmp_path, changes):
    content = bytearray(image().to_bytes())
    for place, value in changes.items():
        content[place] = value
    (tmp_path / "v").write_bytes(content)
    with suppress(InvalidInput):
        assert import_volume(tmp_path / "v").values.ndim == 3
