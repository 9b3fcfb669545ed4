"""NIfTI: round trip of values, scale and units, compressed or not; damage is rejected."""

import gzip
import io
from contextlib import suppress
from itertools import permutations, product

import nibabel
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.nifti_reading import nifti_image
from bentray_workers.files.volume import Volume
from bentray_workers.files.volume_formats import import_volume

from ...effort import effort
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


def turned(order, signs, tilt_deg=0.0):
    """The ramp stored with other axes, and its affine: the same numbers at the same places."""
    stored = ramp(dtype=np.int16).transpose(order)
    stored = stored[tuple(slice(None, None, sign) for sign in signs)]
    # Of each stored node, the node of the ramp.
    to_ramp = np.zeros((4, 4))
    to_ramp[3, 3] = 1.0
    for axis, (of, sign) in enumerate(zip(order, signs, strict=True)):
        to_ramp[of, axis], to_ramp[of, 3] = sign, 0 if sign > 0 else stored.shape[axis] - 1
    tilt, angle = np.eye(4), np.radians(tilt_deg)
    tilt[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return stored, tilt @ AFFINE @ to_ramp


@pytest.mark.parametrize("form", ["sform", "qform"])
@pytest.mark.parametrize("order", list(permutations(range(3))))
@pytest.mark.parametrize("signs", list(product((1, -1), repeat=3)))
def test_turned_and_mirrored_grids_come_out_upright(tmp_path, order, signs, form):
    stored, affine = turned(order, signs)
    made = nibabel.Nifti1Image(stored, affine)
    made.set_sform(affine, 1 if form == "sform" else 0)
    made.set_qform(affine, 1 if form == "qform" else 0)
    (tmp_path / "v").write_bytes(made.to_bytes())
    volume = import_volume(tmp_path / "v")
    np.testing.assert_array_equal(volume.values, ramp(dtype=np.int16))
    np.testing.assert_allclose(volume.spacing_m, (2e-3, 3e-3, 4e-3), rtol=1e-5)
    np.testing.assert_allclose(volume.origin_m, (1e-2, 2e-2, 3e-2), atol=1e-7)


@pytest.mark.parametrize("tilt_deg", [-44.0, 7.0, 44.0])
def test_a_tilted_grid_goes_to_the_nearest_axes(tmp_path, tilt_deg):
    stored, affine = turned((2, 0, 1), (1, -1, 1), tilt_deg)
    (tmp_path / "v").write_bytes(nibabel.Nifti1Image(stored, affine).to_bytes())
    volume = import_volume(tmp_path / "v")
    np.testing.assert_array_equal(volume.values, ramp(dtype=np.int16))
    np.testing.assert_allclose(volume.spacing_m, (2e-3, 3e-3, 4e-3), rtol=1e-5)


def test_without_directions_a_grid_stays_as_it_is_stored(tmp_path):
    # Nibabel writes a quaternion of code 0.
    (tmp_path / "v").write_bytes(spoilt("sform_code", 0))
    volume = import_volume(tmp_path / "v")
    np.testing.assert_array_equal(volume.values, ramp(dtype=np.int16))
    np.testing.assert_allclose(volume.spacing_m, (2e-3, 3e-3, 4e-3))
    assert volume.origin_m == (0.0, 0.0, 0.0)


def test_a_sheared_grid_is_rejected(tmp_path):
    sheared = AFFINE.copy()
    sheared[0, 1] = 0.5
    (tmp_path / "v").write_bytes(nibabel.Nifti1Image(ramp(), sheared).to_bytes())
    error = refused(tmp_path / "v")
    assert error.field == "affine"
    assert "80.54 degrees" in error.value


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


def test_rejects_decompression_bombs(tmp_path):
    (tmp_path / "v").write_bytes(gzip.compress(image().to_bytes() + b"\0" * 200_000_000, 9))
    assert "more data after the values" in refused(tmp_path / "v").value


def test_a_few_bytes_may_follow_the_values(tmp_path):
    (tmp_path / "v").write_bytes(gzip.compress(image().to_bytes() + b"\0" * 512))
    np.testing.assert_array_equal(import_volume(tmp_path / "v").values, ramp(dtype=np.int16))


@pytest.mark.parametrize("byte", [-1, -4, -5, -8, -40])
def test_a_flipped_bit_in_packed_values_their_check_sum_or_length_is_rejected(tmp_path, byte):
    """Stored without compression, so that the flip changes a value and nothing else.

    The values are longer than what gzip reads ahead, where it would meet the check sum by chance.
    """
    values = np.zeros((60, 60, 60), np.int16)
    content = bytearray(gzip.compress(image(values).to_bytes(), compresslevel=0))
    content[byte] ^= 1
    (tmp_path / "v").write_bytes(content)
    assert "damaged data" in refused(tmp_path / "v").value


@pytest.mark.parametrize("missing", [1, 8])
def test_packed_values_without_the_whole_check_sum_are_rejected(tmp_path, missing):
    (tmp_path / "v").write_bytes(gzip.compress(image().to_bytes())[:-missing])
    assert "damaged data" in refused(tmp_path / "v").value


@settings(max_examples=effort(20, 150), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.dictionaries(st.integers(0, 347), st.integers(0, 255), min_size=1, max_size=6))
def test_a_damaged_header_is_read_or_refused_and_nothing_else(tmp_path, changes):
    content = bytearray(image().to_bytes())
    for path, value in changes.items():
        content[path] = value
    (tmp_path / "v").write_bytes(content)
    with suppress(InvalidInput):
        assert import_volume(tmp_path / "v").values.ndim == 3


def test_a_stream_is_read_as_a_volume():
    values = np.arange(24, dtype=np.uint8).reshape(4, 3, 2)
    image = nibabel.Nifti1Image(values, np.diag((1.0, 2.0, 3.0, 1.0)))
    volume = Volume.from_image(nifti_image(io.BytesIO(image.to_bytes())))
    assert volume.spacing_m == pytest.approx((1e-3, 2e-3, 3e-3))
    assert np.array_equal(volume.values, values)
