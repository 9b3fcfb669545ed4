"""Volumes as files: round trip, and rejected input."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from bentray_kernels.errors import InvalidInput
from bentray_workers.files.volume import Volume, read_volume, write_volume

STEPS = (1e-3, 2e-3, 3e-3)


@pytest.mark.parametrize(
    ("dtype", "kept"),
    [
        (np.uint8, np.uint8),
        (np.uint16, np.uint16),
        (">u2", np.uint16),
        (np.float32, np.float32),
        (np.float64, np.float32),
        (np.int16, np.float32),
        (np.float16, np.float32),
        (bool, np.float32),
    ],
)
def test_a_volume_survives_its_file(tmp_path, dtype, kept):
    values = (np.arange(60).reshape(3, 4, 5) % 2).astype(dtype)
    write_volume(tmp_path / "v.h5", Volume.from_values(values, STEPS, (0.1, -0.2, 0.3), "A  title"))
    read = read_volume(tmp_path / "v.h5")
    assert read.values.dtype == kept
    np.testing.assert_array_equal(read.values, values.astype(kept))
    assert (read.spacing_m, read.origin_m, read.title) == (STEPS, (0.1, -0.2, 0.3), "A  title")
    assert read.range() == (0.0, 1.0)


@given(arrays.arrays(np.float32, arrays.array_shapes(min_dims=3, max_dims=3, min_side=2, max_side=5)))
def test_a_volume_is_finite_or_refused(values):
    if np.isfinite(values).all():
        np.testing.assert_array_equal(Volume.from_values(values, STEPS).values, values)
    else:
        with pytest.raises(InvalidInput, match="finite"):
            Volume.from_values(values, STEPS)


def test_a_number_too_large_for_float32_is_named():
    values = np.zeros((2, 2, 2))
    values[1, 0, 1] = 1e300
    with pytest.raises(InvalidInput, match=r"found 1e\+300, beyond float32"):
        Volume.from_values(values, STEPS)
    values[1, 0, 0] = np.inf
    with pytest.raises(InvalidInput, match=r"found inf at node \(1, 0, 0\)"):
        Volume.from_values(values, STEPS)


@pytest.mark.parametrize(
    ("values", "dtype"),
    [
        (1e9 + np.arange(8) / 7, "<f8"),
        (16777216 + np.arange(8) % 4, "<i4"),
        (16777216 + np.arange(8) % 4, ">u4"),
        (-(2**62) + np.arange(8), "<i8"),
        (1.0 + np.arange(8) * 1e-9, ">f8"),
    ],
)
def test_rejects_values_indistinguishable_in_float32(values, dtype):
    with pytest.raises(InvalidInput, match=r"cannot distinguish; accepted: .*subtract an offset first"):
        Volume.from_values(values.astype(dtype).reshape(2, 2, 2), STEPS)


@pytest.mark.parametrize(
    ("values", "dtype"),
    [
        (16777216 + 2 * np.arange(8), "i4"),
        (np.full(8, 0.1), "f8"),
        (1e9 * np.arange(8) / 7, "f8"),
        (1.0 + np.arange(8) * 1e-4, "f8"),
        (np.arange(8) * 2**60 - 2**62, "i8"),
    ],
)
def test_accepts_values_distinguishable_in_float32(values, dtype):
    volume = Volume.from_values(values.astype(dtype).reshape(2, 2, 2), STEPS)
    assert len(np.unique(volume.values)) == len(np.unique(values))


@pytest.mark.parametrize("step", [1e-300, 0.99e-9, 1.01e3, 1e300, float("inf")])
@pytest.mark.parametrize("axis", range(3))
def test_rejects_implausible_spacing(step, axis):
    steps = [1e-3] * 3
    steps[axis] = step
    with pytest.raises(InvalidInput, match=r"spacing_m: .* three times a number from 1e-09 to 1000 m"):
        Volume.from_values(np.zeros((2, 2, 2)), steps)


def test_the_closest_and_the_farthest_spacing_are_kept():
    assert Volume.from_values(np.zeros((2, 2, 2)), (1e-9, 1.0, 1e3)).spacing_m == (1e-9, 1.0, 1e3)


@given(st.text())
def test_a_title_from_a_stranger_can_be_stored(title):
    kept = Volume.from_values(np.zeros((2, 2, 2)), STEPS, title=title).title
    assert len(kept) <= 200
    kept.encode()
