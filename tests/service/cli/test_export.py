"""`bentray export`: the suffix selects the format; what cannot be written is named."""

import json
from dataclasses import replace
from pathlib import Path
from typing import get_args

import nibabel
import numpy as np
import pytest

from bentray_workers.files.export.registry import FORMATS, SUFFIXES, FormatName
from bentray_workers.files.reconstruction import read_reconstruction, write_reconstruction

from ...workers.files.reconstructions import made
from .conftest import Run


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    result = made(nodes=6)
    provenance = {**result.provenance, "frequency_hz": "1e6"}
    write_reconstruction(tmp_path / "reconstruction.h5", replace(result, provenance=provenance))
    return tmp_path


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_suffix_is_written(bentray: Run, folder: Path, suffix: str) -> None:
    target = folder / f"image{suffix}"
    result = bentray("export", folder, "-o", target, "--json")
    assert json.loads(result.stdout)["format"] == SUFFIXES[suffix]
    assert target.exists()
    if SUFFIXES[suffix] == "hdf5":
        np.testing.assert_array_equal(read_reconstruction(target).speed, made(nodes=6).speed)
    again = bentray("export", folder, "-o", target, code=2)
    assert "exists" in again.stderr


def test_every_format_is_listed_where_it_can_be_chosen(bentray: Run) -> None:
    assert get_args(FormatName) == tuple(FORMATS)
    for command in ("export", "download"):
        text = " ".join(bentray(command, "--help").stdout.split())
        assert all(form.title in text for form in FORMATS.values()), command


def test_quantity_and_unit_are_options(bentray: Run, folder: Path) -> None:
    target, source = folder / "loss.nii", folder / "reconstruction.h5"
    how = ("--quantity", "attenuation", "--attenuation", "dB/cm/MHz")
    for more, factor in (((), 0.0868589), (("--frequency", 2e6, "--force"), 0.0434294)):
        bentray("export", source, "-o", target, *how, *more)
        expected = factor * made(nodes=6).attenuation
        np.testing.assert_allclose(nibabel.load(target).get_fdata(), expected, rtol=1e-5)
