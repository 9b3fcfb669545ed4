"""NIfTI files that are written: read back by nibabel and by ourselves, refused where the grid is uneven."""

import nibabel
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.export.content import Content
from bentray_workers.files.export.registry import EXPORTED
from bentray_workers.files.volume_axes import Grid
from bentray_workers.files.volume_formats import import_volume

from ....effort import effort
from ..volumes import ramp

SPACING, ORIGIN = (1e-3, 2e-3, 3e-3), (-0.01, 0.0, 0.02)
GRID = Grid(SPACING, ORIGIN)


def write_nifti(path, values, grid, title):
    EXPORTED["nifti"].write(path, Content(values, grid, title, {"values": values}))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32, np.float64])
def test_written_file_round_trips(tmp_path, dtype):
    write_nifti(tmp_path / "v.nii", ramp(dtype=dtype), GRID, "a head")
    volume = import_volume(tmp_path / "v.nii")
    np.testing.assert_array_equal(volume.values, ramp(dtype=dtype))
    np.testing.assert_allclose(volume.spacing_m, SPACING, rtol=1e-6)
    np.testing.assert_allclose(volume.origin_m, ORIGIN, rtol=1e-6)
    assert volume.title == "a head"


def test_nibabel_finds_every_node_where_it_is(tmp_path):
    write_nifti(tmp_path / "v.nii", ramp(), GRID, "")
    image = nibabel.load(tmp_path / "v.nii")
    assert image.header.get_xyzt_units()[0] == "mm"
    np.testing.assert_allclose(image.affine @ [2, 3, 4, 1], [-8.0, 6.0, 32.0, 1.0], rtol=1e-6)
    np.testing.assert_allclose(image.get_qform(), image.get_sform(), atol=1e-6)


def test_a_slice_has_two_axes(tmp_path):
    write_nifti(tmp_path / "v.nii", ramp()[..., 0], Grid(SPACING[:2], ORIGIN[:2]), "")
    image = nibabel.load(tmp_path / "v.nii")
    np.testing.assert_array_equal(image.get_fdata(), ramp()[..., 0])
    np.testing.assert_allclose(np.diag(image.affine), [1.0, 2.0, 1.0, 1.0])


def test_a_long_axis_takes_nifti_2(tmp_path):
    write_nifti(tmp_path / "v.nii", np.ones((2, 40_000, 2), np.uint8), GRID, "")
    assert import_volume(tmp_path / "v.nii").values.shape == (2, 40_000, 2)


@settings(max_examples=effort(20, 30), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(max_size=120))
def test_any_title_fits(tmp_path, title):
    write_nifti(tmp_path / "v.nii", ramp(), GRID, title)
    kept = bytes(nibabel.load(tmp_path / "v.nii").header["descrip"].item())
    assert title.encode().startswith(kept)
    assert len(kept) > 70 or kept.decode() == title.rstrip("\0")


def test_uneven_slices_are_rejected_and_leave_no_file(tmp_path):
    with pytest.raises(InvalidInput) as refusal:
        write_nifti(tmp_path / "v.nii", ramp(), Grid((1e-3, 1e-3, float("nan")), ORIGIN), "")
    assert refusal.value.field == "volume"
    assert not list(tmp_path.iterdir())
