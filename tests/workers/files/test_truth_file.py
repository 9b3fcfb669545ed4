"""Truths from files: every format puts the same speeds at the same places; what does not fit is named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bentray_kernels.acquisition import Dataset
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.comparison import compare
from bentray_workers.files.dataset import write_dataset
from bentray_workers.files.reconstruction import write_reconstruction
from bentray_workers.files.truth_file import read_truth
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.files.volume_export import Selection, export_image

from .reconstructions import made, truth

SOLID = replace(made(nodes=10, slices=5), spacing_m=(2e-3, 2e-3, 3e-3))


@pytest.mark.parametrize("name", ["image.npy", "image.nii", "image.nii.gz", "image.nrrd"])
@pytest.mark.parametrize("slices", [None, 5])
def test_an_exported_image_is_its_own_truth(tmp_path: Path, name: str, slices: int | None) -> None:
    image = made(nodes=10) if slices is None else SOLID
    file = tmp_path / name
    kind = {"npy": "npy", "nrrd": "nrrd"}.get(name.rpartition(".")[2], "nifti")
    export_image(image, target=file, name=kind, selection=Selection())
    result = read_truth(file, image).truth
    np.testing.assert_allclose(result.spacing_m, image.spacing_m, rtol=1e-6)
    np.testing.assert_allclose(result.origin_m, image.origin_m, rtol=1e-6)
    assert compare(image, result).rms < 1e-3


def test_a_dataset_has_truth_and_region(tmp_path: Path) -> None:
    ring = np.array([[0.03, 0.0], [0.0, 0.03], [-0.03, 0.0]])
    roi = truth(12).sound_speed_mps > 1510.0
    dataset = Dataset(ring, np.arange(3), np.arange(3), 1500.0, delta_tof_s=np.zeros((3, 3)), roi=roi)
    write_dataset(tmp_path / "scan.h5", replace(dataset, truth=truth(12)))
    true_image = read_truth(tmp_path / "scan.h5", made(12))
    np.testing.assert_array_equal(true_image.truth.sound_speed_mps, truth(12).sound_speed_mps)
    np.testing.assert_array_equal(true_image.roi, roi)
    write_dataset(tmp_path / "real.h5", dataset)
    with pytest.raises(InvalidInput, match="a dataset without truth"):
        read_truth(tmp_path / "real.h5", made(12))


def test_a_result_or_a_volume_is_taken_as_true(tmp_path: Path) -> None:
    write_reconstruction(tmp_path / "reconstruction.h5", SOLID)
    true_image = read_truth(tmp_path / "reconstruction.h5", SOLID).truth
    np.testing.assert_array_equal(true_image.sound_speed_mps, SOLID.speed)
    np.testing.assert_array_equal(true_image.attenuation_np_m, SOLID.attenuation)
    write_volume(tmp_path / "volume.h5", Volume.from_values(SOLID.speed, SOLID.spacing_m, SOLID.origin_m))
    assert compare(SOLID, read_truth(tmp_path / "volume.h5", SOLID).truth).rms < 1e-3


def test_a_numpy_file_is_centred_or_on_the_nodes_of_the_image(tmp_path: Path) -> None:
    file, image = tmp_path / "true.npy", made(nodes=10)
    np.save(file, np.full((21, 11), 1540.0))
    result = read_truth(file, image, [1e-3]).truth
    assert (result.spacing_m, result.origin_m) == ((1e-3, 1e-3), (-0.01, -0.005))
    with pytest.raises(InvalidInput, match=r"^spacing: .*10 x 10 nodes"):
        read_truth(file, image)
    with pytest.raises(InvalidInput, match="or 2"):
        read_truth(file, image, [1e-3] * 3)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (np.full((3, 3), 1.54), "speeds in m/s"),
        (np.array([["a"]]), "real numbers"),
        (np.ones(4), "real numbers"),
    ],
)
def test_values_that_are_no_speeds_are_named(tmp_path: Path, values: np.ndarray, said: str) -> None:
    np.save(tmp_path / "true.npy", values)
    with pytest.raises(InvalidInput, match=said):
        read_truth(tmp_path / "true.npy", made(nodes=10), [1e-3])


def test_other_files_are_refused(tmp_path: Path) -> None:
    export_image(SOLID, target=tmp_path / "a.nii", name="nifti", selection=Selection())
    with pytest.raises(InvalidInput, match="only NumPy files"):
        read_truth(tmp_path / "a.nii", SOLID, [1e-3])
    (tmp_path / "notes.txt").write_text("speed 1540")
    with pytest.raises(InvalidInput, match="file of another kind"):
        read_truth(tmp_path / "notes.txt", SOLID)
    with pytest.raises(InvalidInput, match="No such file"):
        read_truth(tmp_path / "none.npy", SOLID)
    (tmp_path / "cut.npy").write_bytes(b"\x93NUMPY\x01\x00")
    with pytest.raises(InvalidInput, match="damaged"):
        read_truth(tmp_path / "cut.npy", SOLID)
