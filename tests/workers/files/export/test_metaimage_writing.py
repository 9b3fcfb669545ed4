"""MetaImage as another program reads it: the same numbers at the same places."""

import numpy as np
import pytest
import SimpleITK
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.export.content import Content
from bentray_workers.files.export.metaimage_writing import ELEMENTS
from bentray_workers.files.export.registry import EXPORTED
from bentray_workers.files.volume_axes import Grid

from ....effort import effort

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


def test_uneven_heights_are_rejected(tmp_path):
    with pytest.raises(InvalidInput) as caught:
        write_metaimage(tmp_path / "v.mha", np.zeros((2, 2, 2)), Grid((1e-3, 1e-3, np.nan), (0.0,) * 3), "")
    assert caught.value.field == "volume"
    assert not list(tmp_path.iterdir())
