"""Reconstruction files: exact round trips, the promised names, and refusals; every list of quantities."""

import json
import re
from dataclasses import fields, replace
from pathlib import Path
from typing import get_args

import h5py
import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Iteration, Reconstruction, Settings
from bentray_kernels.tomography.numerics import recorded
from bentray_service.interactive.result import Result
from bentray_workers.files.quantities import QUANTITIES, QuantityName
from bentray_workers.files.reconstruction import read_reconstruction, write_reconstruction
from bentray_workers.images.report import COLORMAPS

from .reconstructions import made
from .test_dataset_files import assert_same


@pytest.mark.parametrize("slices", [None, 3])
@pytest.mark.parametrize("with_attenuation", [True, False])
def test_written_file_round_trips_bit_for_bit(tmp_path, slices, with_attenuation):
    result = made(slices=slices)
    if not with_attenuation:
        result = replace(result, attenuation=None)
    write_reconstruction(tmp_path / "r.h5", result)
    restored = read_reconstruction(tmp_path / "r.h5")
    # NaN, which says that slices are not evenly spaced, equals itself here.
    np.testing.assert_array_equal(restored.spacing_m, result.spacing_m)
    assert_same(replace(restored, spacing_m=()), replace(result, spacing_m=()))


@pytest.mark.parametrize("slices", [None, 3])
def test_the_uncertainty_comes_back_with_its_resolution_widths(tmp_path, slices):
    widths = (1.5e-3, 2e-3, 0.0)[: slices or 1]
    spread = np.random.default_rng(1).uniform(0.0, 9.0, made(slices=slices).speed.shape)
    result = replace(made(slices=slices), uncertainty=spread, resolution_width_m=widths)
    write_reconstruction(tmp_path / "r.h5", result)
    restored = read_reconstruction(tmp_path / "r.h5")
    assert np.array_equal(restored.uncertainty, spread)
    assert restored.resolution_width_m == widths
    assert restored.image("uncertainty").spacing_m == restored.spacing_m
    for wrong in (-1e-3, np.nan):
        with h5py.File(tmp_path / "r.h5", "r+") as file:
            file["uncertainty_mps"].attrs["resolution_width_m"] = [wrong]
        with pytest.raises(InvalidInput, match="uncertainty_mps@resolution_width_m"):
            read_reconstruction(tmp_path / "r.h5")
    with h5py.File(tmp_path / "r.h5", "r+") as file:
        del file["uncertainty_mps"].attrs["resolution_width_m"]
    with pytest.raises(InvalidInput, match="uncertainty_mps@resolution_width_m"):
        read_reconstruction(tmp_path / "r.h5")


def test_bands_of_a_refinement_come_back(tmp_path):
    waves = (
        Iteration(0, 1, 3e-8, 36, 1, given=False, band_hz=(1e5, 2e5), misfit=0.3, held_out_misfit=0.4),
        Iteration(0, 2, 2e-8, 36, 1, band_hz=(1e5, 2e5), misfit=0.1),
        Iteration(0, 1, 2e-8, 24, 2, band_hz=(2e5, 3e5), misfit=0.2, of_attenuation=True),
    )
    whole = replace(made(), history=(*made().history, *waves))
    write_reconstruction(tmp_path / "r.h5", whole)
    assert read_reconstruction(tmp_path / "r.h5").history == whole.history
    with h5py.File(tmp_path / "r.h5", "r+") as file:
        del file["history/misfit"]
    with pytest.raises(InvalidInput, match="history/misfit"):
        read_reconstruction(tmp_path / "r.h5")


def test_numerical_parameters_come_back(tmp_path):
    settings = Settings.from_values(method="sart", nodes=24, subset=4, bands=2)
    result = replace(made(), settings=settings, provenance=recorded(settings.numerics))
    write_reconstruction(tmp_path / "r.h5", result)
    assert read_reconstruction(tmp_path / "r.h5").settings == settings


def test_a_result_without_history_comes_back(tmp_path):
    write_reconstruction(tmp_path / "r.h5", replace(made(), history=(), provenance={}))
    assert read_reconstruction(tmp_path / "r.h5").history == ()


def test_file_uses_the_documented_names(tmp_path):
    result = made(slices=2)
    write_reconstruction(tmp_path / "r.h5", result)
    with h5py.File(tmp_path / "r.h5") as file:
        np.testing.assert_array_equal(file["speed_mps"][()], result.speed)
        np.testing.assert_array_equal(file["coverage_m"][()], result.coverage)
        np.testing.assert_array_equal(file["attenuation_np_m"][()], result.attenuation)
        assert file.attrs["axes"] == "x,y,z"
        assert file.attrs["spacing_m"].shape == (3,)
        assert file.attrs["origin_m"].tolist() == list(result.origin_m)
        assert json.loads(file.attrs["settings"])["rays"] == "straight"
        assert json.loads(file.attrs["provenance"])["bentray"] == "0.1.0"
        assert file["history/residual_rms_s"].shape == (6,)


def test_the_same_result_gives_the_same_bytes(tmp_path):
    write_reconstruction(tmp_path / "a.h5", made())
    write_reconstruction(tmp_path / "b.h5", made())
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def drop(name):
    return lambda file: file.pop(name)


def attr(name, value):
    return lambda file: file.attrs.__setitem__(name, value)


@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("@format", attr("format", "uct-transmission")),
        ("speed_mps", drop("speed_mps")),
        ("coverage_m", lambda f: (f.pop("coverage_m"), f.create_dataset("coverage_m", data=np.ones((2, 2))))),
        ("@spacing_m", attr("spacing_m", [1.0])),
        ("@water_speed_mps", lambda f: f.attrs.pop("water_speed_mps")),
        ("@settings", attr("settings", "not JSON")),
        ("@settings", attr("settings", "[1]")),
        ("@settings", attr("settings", '{"from": "the future"}')),
        ("@settings", attr("settings", '{"iterations": "many"}')),
        ("rays", attr("settings", '{"rays": "wavy"}')),
        ("@provenance", attr("provenance", "")),
        ("history/sweep", lambda f: f["history"].pop("sweep")),
        ("history", lambda f: (f["history"].pop("sweep"), f["history"].create_dataset("sweep", data=[1]))),
    ],
)
def test_a_wrong_field_is_named(tmp_path, field, change):
    write_reconstruction(tmp_path / "r.h5", made())
    with h5py.File(tmp_path / "r.h5", "a") as file:
        change(file)
    with pytest.raises(InvalidInput, match=f"^{field}: "):
        read_reconstruction(tmp_path / "r.h5")


def test_a_file_cut_short_is_rejected(tmp_path):
    write_reconstruction(tmp_path / "r.h5", made())
    whole = (tmp_path / "r.h5").read_bytes()
    for length in range(0, len(whole), len(whole) // 40):
        (tmp_path / "r.h5").write_bytes(whole[:length])
        with pytest.raises(InvalidInput):
            read_reconstruction(tmp_path / "r.h5")


PAGE = Path(__file__).resolve().parents[3] / "service" / "bentray_service" / "web" / "static"


def test_names_are_those_of_requests_and_results() -> None:
    assert get_args(QuantityName) == tuple(QUANTITIES)
    assert set(QUANTITIES) <= {field.name for field in fields(Reconstruction)}
    assert set(QUANTITIES) <= set(dir(Result))


@pytest.mark.parametrize("name", QUANTITIES)
def test_each_has_colours_and_is_on_the_page(name: str) -> None:
    assert name == "speed" or name in COLORMAPS
    for script in ("viewer/quantities.js", "parts/export_menu.js"):
        assert re.search(rf"\b{name}: ", (PAGE / script).read_text()), script
