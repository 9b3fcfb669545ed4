"""`bentray compare`: figures, statistics of regions, picture, and input that is refused."""

import json
from pathlib import Path

import numpy as np
import pytest

from bentray_kernels.tomography import rmse, structural_similarity
from bentray_workers.files.reconstruction import write_reconstruction

from ...workers.files.reconstructions import made, truth
from .conftest import Run


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_reconstruction(tmp_path / "reconstruction.h5", made(48))
    np.save(tmp_path / "truth.npy", truth(48).sound_speed_mps)
    return tmp_path


def test_figures_and_regions_are_printed_and_drawn(bentray: Run, folder: Path) -> None:
    picture = folder / "comparison.png"
    words = (folder, folder / "truth.npy", "--region", "9.4,0,18", "-o", picture)
    result = bentray("compare", *words, "--json")
    record = json.loads(result.stdout)
    image, true = made(48).speed, truth(48).sound_speed_mps
    object_ = true != 1500.0
    assert record["nodes"] == object_.sum()
    assert record["rmse"] == pytest.approx(rmse(image, true, object_))
    assert record["ssim"] == pytest.approx(structural_similarity(image, true, object_, 40.0))
    assert record["statistics"]["truth"]["mean"] == pytest.approx(1540.0)
    assert record["statistics"]["truth"]["size"] == pytest.approx(object_.sum() * 4e-6)
    (region,) = record["regions"]
    assert region["truth"]["contrast"] == pytest.approx(40.0, rel=0.3)
    assert region["image"]["contrast"] == pytest.approx(region["truth"]["contrast"], abs=2.0)
    assert picture.read_bytes().startswith(b"\x89PNG")
    table = bentray("compare", *words, "--force").stdout
    assert f"{record['rmse']:.4g} m/s" in table
    assert "(9.4, 0) mm" in table


def test_a_volume_has_balls(bentray: Run, tmp_path: Path) -> None:
    from dataclasses import replace

    solid = replace(made(nodes=10, slices=5), spacing_m=(2e-3, 2e-3, 3e-3))
    write_reconstruction(tmp_path / "reconstruction.h5", solid)
    result = bentray("compare", tmp_path, tmp_path, "--region", "0,0,16,4", "--json")
    record = json.loads(result.stdout)
    assert (record["rmse"], record["correlation"]) == (0.0, pytest.approx(1.0))
    assert record["regions"][0]["image"] == record["regions"][0]["truth"]
