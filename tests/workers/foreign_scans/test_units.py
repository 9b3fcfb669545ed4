"""A scan in another unit is rejected with the same message whatever the file format."""

import numpy as np
import pytest
from scipy.io import savemat

from bentray_kernels.acquisition import Dataset
from bentray_kernels.errors import InvalidInput
from bentray_workers.files.dataset import write_dataset
from bentray_workers.foreign_scans import convert_dataset

from .scans import ELEMENTS, delta_tof, positions, write_matlab73


def canonical(path, position, delta):
    every = np.arange(ELEMENTS)
    write_dataset(path, Dataset(position, every, every, 1500.0, delta_tof_s=delta))


def archive(path, position, delta):
    with path.open("wb") as file:
        np.savez(file, element_positions=position, delta_tof=delta)


def matlab5(path, position, delta):
    savemat(path, {"element_positions": position, "delta_tof": delta})


def matlab73(path, position, delta):
    write_matlab73(path, {"element_positions": position, "delta_tof": delta})


def converted(tmp_path, write, position, delta):
    write(tmp_path / "scan", position, delta)
    return convert_dataset(tmp_path / "scan", tmp_path / "canonical.h5")


@pytest.mark.parametrize("write", [canonical, archive, matlab5, matlab73])
def test_the_likely_unit_is_named(tmp_path, write):
    assert converted(tmp_path, write, positions(), delta_tof()).picked
    for place, factors, words in (
        ("geometry/element_position_m", (1e3, 1.0), "these positions look like mm: write m"),
        ("geometry/element_position_m", (1e-3, 1.0), "these positions look like km: write m"),
        ("traveltime/delta_tof_s", (1.0, 1e6), "these times look like µs: write s"),
    ):
        with pytest.raises(InvalidInput, match=words) as refusal:
            converted(tmp_path, write, factors[0] * positions(), factors[1] * delta_tof())
        assert refusal.value.field == place
