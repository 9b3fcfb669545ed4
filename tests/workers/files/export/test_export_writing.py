"""Exported files: the bytes, types and titles that other programs read."""

import nibabel
import numpy as np
import pytest
import SimpleITK
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.io import loadmat

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.export import mat_writing
from bentray_workers.files.export.content import Content
from bentray_workers.files.export.metaimage_writing import ELEMENTS
from bentray_workers.files.export.registry import EXPORTED
from bentray_workers.files.volume_axes import Grid
from bentray_workers.files.volume_formats import import_volume

from ....effort import effort
from ..volumes import ramp

SPEED = np.arange(24.0).reshape(2, 3, 4)


CONTENT = Content(SPEED, Grid((1.0, 2.0, 3.0), (0.0,) * 3), "a title", {"speed_mps": SPEED})


def test_the_same_arrays_give_the_same_bytes(tmp_path, monkeypatch):
    mat_writing.write(tmp_path / "once.mat", CONTENT)
    monkeypatch.setattr("time.asctime", lambda *when: "another time")
    mat_writing.write(tmp_path / "twice.mat", CONTENT)
    assert (tmp_path / "once.mat").read_bytes() == (tmp_path / "twice.mat").read_bytes()
    assert loadmat(tmp_path / "once.mat")["title"].item() == "a title"


def test_rejects_arrays_too_large_for_the_version(tmp_path, monkeypatch):
    monkeypatch.setattr(mat_writing, "LARGEST_BYTES", 191)
    with pytest.raises(InvalidInput, match="speed_mps of 192 bytes"):
        mat_writing.write(tmp_path / "v.mat", CONTENT)
    assert not list(tmp_path.iterdir())


steps = st.floats(1e-6, 1e-1)


places = st.floats(-1.0, 1.0)


def write_metaimage(path, values, grid, title):
    EXPORTED["metaimage"].write(path, Content(values, grid, title, {"values": values}))


@settings(deadline=None, max_examples=effort(20, 40))
@given(dtype=st.sampled_from(list(ELEMENTS)), shape=hnp.array_shapes(min_dims=2, max_dims=3), data=st.data())
def test_another_program_reads_the_same(tmp_path_factory, dtype, shape, data):
    path = tmp_path_factory.mktemp("mha") / "v.mha"
    values = data.draw(hnp.arrays(dtype, shape, elements={"allow_nan": False} if dtype[0] == "f" else None))
    spacing = data.draw(st.lists(steps, min_size=len(shape), max_size=len(shape)))
    origin = data.draw(st.lists(places, min_size=len(shape), max_size=len(shape)))
    write_metaimage(path, values, Grid(spacing, origin), "a title")
    image = SimpleITK.ReadImage(str(path))
    # Its arrays run z, y, x.
    np.testing.assert_array_equal(SimpleITK.GetArrayFromImage(image).T, values)
    np.testing.assert_allclose(image.GetSpacing(), 1e3 * np.array(spacing))
    # Those of MetaImage go to the left and back.
    lps = np.array([-1.0, -1.0, 1.0][: len(shape)])
    np.testing.assert_allclose(image.GetOrigin(), 1e3 * lps * origin, atol=1e-9)
    np.testing.assert_array_equal(image.GetDirection(), np.diag(lps).ravel())


def test_a_title_stays_in_its_line(tmp_path):
    write_metaimage(
        tmp_path / "v.mha", np.zeros((2, 2, 2)), Grid((1e-3,) * 3, (0.0,) * 3), "a\nDimSize = 9 9 9"
    )
    assert SimpleITK.ReadImage(str(tmp_path / "v.mha")).GetSize() == (2, 2, 2)


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
