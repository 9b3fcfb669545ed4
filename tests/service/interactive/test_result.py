"""Results: pictures, comparisons, conversions and files, with places and units that agree."""

import sys
from dataclasses import replace
from pathlib import Path

import nibabel
import numpy as np
import pytest
from matplotlib import pyplot as plt

import bentray
from bentray_kernels.tomography.result import Caution, Reflection
from bentray_service.interactive.result import Result, result_of
from bentray_workers.files.volume import Volume

from ...workers.files.reconstructions import made, truth

SPACING_M = 2e-3


@pytest.fixture
def result() -> Result:
    return result_of(made(nodes=12), {"title": "A <b>disc</b>"}, truth=truth(nodes=12))


@pytest.fixture(autouse=True)
def _closed_figures() -> None:
    plt.close("all")


def volume(values: np.ndarray) -> Result:
    return result_of(Volume.from_values(values, (1e-3,) * 3, title="Cube"), {})


def test_arrays_have_places_and_units(result: Result) -> None:
    assert result.axes == ("x", "y")
    units = {"speed": "m/s", "coverage": "m", "attenuation": "Np/m", "recovery": "1"}
    assert dict(result.units) == units
    np.testing.assert_allclose(result.coordinates["x"], SPACING_M * (np.arange(12) - 5.5))
    np.testing.assert_array_equal(result.speed, made(nodes=12).speed)
    np.testing.assert_array_equal(result.attenuation, made(nodes=12).attenuation)
    assert result.attributes["bentray"] == "0.1.0"
    assert result.trials[0].settings == {"rays": "straight", "relaxation": 0.03}
    assert repr(result).startswith(
        "<bentray.Result of 12 x 12 nodes: speed, coverage, recovery, attenuation;"
    )


def test_print_says_method_water_pairs_residual_cautions_and_time(result: Result) -> None:
    cautions = (Caution("bounds", "Cut off.", doubtful=True), Caution("settings", "No effect."))
    pairs = "9 of 12 pairs used, 3 left out"
    told = {"pairs": pairs, "noise": "12 ns", "water": "20 °C", "seconds": "1.50"}
    image = replace(made(nodes=12), cautions=cautions, uncertainty=np.full((12, 12), 4.0))
    image = replace(image, resolution_width_m=(0.002,), provenance={**image.provenance, **told})
    lines = str(result_of(image, {})).splitlines()
    assert lines[0].startswith("Doubtful result. Cut off.")
    subjects = "cut off by the speed bounds, settings without effect"
    assert f"Trust: ±4 m/s (1 sd), detail down to 4.7 mm, 2 cautions: {subjects}" in lines
    assert {"Caution: No effect.", "Water: 20 °C", f"Pairs: {pairs}", "Time: 1.50 s"} <= {*lines}
    rms = image.residual_rms_s
    assert rms is not None
    assert f"Residual: {1e9 * rms:.0f} ns rms, noise 12 ns" in lines
    assert any(line.startswith("Method: ") for line in lines)
    assert "Trust: no standard deviations, no cautions" in str(result)


def test_the_uncertainty_has_a_resolution_width(result: Result) -> None:
    spread = np.linspace(0.0, 9.0, 144).reshape(12, 12)
    certain = result_of(replace(made(nodes=12), uncertainty=spread, resolution_width_m=(0.002,)), {})
    np.testing.assert_array_equal(certain.uncertainty, spread)
    assert certain.units["uncertainty"] == "m/s"
    assert certain.resolution_width_m == (0.002,)
    assert result.resolution_width_m == ()
    with pytest.raises(bentray.InvalidInput, match="uncertainty"):
        _ = result.uncertainty


def test_reflection_has_a_grid_of_its_own(result: Result) -> None:
    db = np.linspace(-100.0, 0.0, 30 * 20).reshape(30, 20)
    image = replace(made(nodes=12), reflection=Reflection(db, (5e-4, 5e-4), (-7e-3, -5e-3)))
    both = result_of(image, {})
    np.testing.assert_array_equal(both.reflection, db)
    assert (both.units["reflection"], both.axes_of("reflection")) == ("dB", ("reflection_x", "reflection_y"))
    np.testing.assert_allclose(both.coordinates["reflection_x"], 5e-4 * np.arange(30) - 7e-3)
    assert both.to_xarray()["reflection"].shape == (30, 20)
    left, right, *_ = both.plot("reflection").images[0].get_extent()
    assert (left, right) == pytest.approx((-7.25, 7.75))
    assert both.compare(both, "reflection").spacing_m == (5e-4, 5e-4)
    with pytest.raises(bentray.InvalidInput, match="reflection"):
        _ = result.reflection


def test_missing_arrays_are_named() -> None:
    bare = result_of(replace(made(nodes=12), attenuation=None, recovery=None), {})
    with pytest.raises(
        bentray.InvalidInput, match="quantity: found 'attenuation'; accepted: one of speed, cov"
    ):
        _ = bare.attenuation
    with pytest.raises(bentray.InvalidInput, match="an uploaded volume; accepted: a reconstruction"):
        _ = volume(np.zeros((3, 3, 3), np.float32)).settings


def test_a_slice_is_drawn_in_mm(result: Result) -> None:
    axes = result.plot("attenuation", low=0.0, high=4.0)
    assert (axes.get_title(), axes.get_xlabel(), axes.get_ylabel()) == (
        "Attenuation (experimental)",
        "x (mm)",
        "y (mm)",
    )
    np.testing.assert_allclose(axes.get_xlim(), (-12.0, 12.0))
    (image,) = axes.get_images()
    assert image.get_clim() == (0.0, 4.0)
    np.testing.assert_array_equal(image.get_array(), result.attenuation.T)
    figure, own = plt.subplots()
    assert result.plot(ax=own) is own
    assert figure.axes[1].get_ylabel() == "sound speed (m/s)"


def test_a_volume_is_cut_across_any_axis() -> None:
    cube = volume(np.arange(60, dtype=np.float32).reshape(3, 4, 5))
    axes = cube.plot(axis="x", index=2)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("y (mm)", "z (mm)")
    assert axes.get_title() == "Cube, slice index 2 (0 to 2), x = 2 mm"
    np.testing.assert_array_equal(axes.get_images()[0].get_array(), cube.values["value"][2].T)
    with pytest.raises(bentray.InvalidInput, match="index: found 3; accepted: 0 to 2"):
        cube.plot(axis="x", index=3)


def test_figures_of_a_comparison(result: Result) -> None:
    image = made(nodes=12)
    shifted = result_of(replace(image, speed=image.speed + np.where(image.speed > 1520.0, 4.0, 0.0)), {})
    compared = shifted.compare(result)
    share = float((image.speed > 1520.0).mean())
    assert compared.region.all()
    assert compared.rms == pytest.approx(4.0 * share**0.5)
    assert compared.mean_absolute == pytest.approx(4.0 * share)
    assert compared.bias == pytest.approx(4.0 * share)
    assert compared.largest == pytest.approx(4.0)
    assert 0.9 < compared.correlation < 1.0
    assert result.compare(result).rms == 0.0
    assert result.compare(result).correlation == pytest.approx(1.0)
    assert "rms" in repr(compared)


def test_a_file_is_a_truth(result: Result, tmp_path: Path) -> None:
    np.save(tmp_path / "true.npy", result.speed - 3.0)
    compared = result.compare(str(tmp_path / "true.npy"))
    assert compared.rms == pytest.approx(3.0)
    assert result.compare(tmp_path / "true.npy", spacing_m=SPACING_M).rms == pytest.approx(3.0)
    with pytest.raises(bentray.InvalidInput, match="truth"):
        result.compare(tmp_path / "none.npy")


def test_statistics_of_a_disc(result: Result) -> None:
    of_image, of_truth = result.compare().statistics((0.0, 0.0), 5e-3)
    assert result.statistics((0.0, 0.0), 5e-3) == of_image
    assert of_image.nodes == of_truth.nodes
    assert of_image.mean == pytest.approx(of_truth.mean, abs=2.0)
    assert of_truth.contrast is not None
    everything, _ = result.compare().statistics()
    assert (everything.nodes, everything.contrast) == (int(result.compare().region.sum()), None)
    with pytest.raises(bentray.InvalidInput, match="radius_m"):
        result.compare().statistics((0.0, 0.0))


def test_nodes_without_rays_do_not_count(result: Result) -> None:
    image = made(nodes=12)
    coverage = image.coverage.copy()
    coverage[:6] = 0.0
    speed = image.speed.copy()
    speed[:6] += 100.0
    compared = result_of(replace(image, speed=speed, coverage=coverage), {}).compare(result)
    assert compared.rms == 0.0
    assert compared.region_choice == "nodes that rays of both images cross"


def test_another_grid_is_interpolated() -> None:
    points = [np.arange(n) * 1e-3 for n in (5, 6, 7)]
    linear = 1.0 + 2e3 * points[0][:, None, None] - 1e3 * points[1][None, :, None] + 5e2 * points[2]
    coarse = volume(linear.astype(np.float32))
    fine_places = np.meshgrid(*(np.arange(3) * 5e-4 + 1e-3 for _ in range(3)), indexing="ij")
    exact = 1.0 + 2e3 * fine_places[0] - 1e3 * fine_places[1] + 5e2 * fine_places[2]
    fine = result_of(Volume.from_values(exact, (5e-4,) * 3, (1e-3,) * 3), {})
    compared = fine.compare(coarse, "value")
    assert compared.region.all()
    np.testing.assert_allclose(compared.difference, 0.0, atol=1e-5)
    outside = result_of(Volume.from_values(exact, (5e-4,) * 3, (1.0,) * 3), {})
    with pytest.raises(bentray.InvalidInput, match="without a common node"):
        outside.compare(coarse, "value")


def test_the_truth_of_a_scan(result: Result, simulated: bentray.Scan) -> None:
    compared = result.compare()
    inside = made(nodes=12).speed - compared.other
    assert compared.rms == pytest.approx(np.sqrt(np.mean(inside[compared.region] ** 2)))
    assert 0.5 < compared.rms < 2.0, "noise of 1 m/s"
    assert compared.names == ("reconstruction", "truth")
    assert result.compare(simulated).region_choice == "mask/roi of the file"
    with pytest.raises(bentray.InvalidInput, match="other: found no other image, of a scan without a truth"):
        replace(result, truth=None).compare()
    with pytest.raises(bentray.InvalidInput, match="quantity: found 'attenuation'; accepted: one of speed"):
        result.compare(quantity="attenuation")
    losses = np.linspace(0.0, 5.0, 144).reshape(12, 12)
    known = replace(result, truth=replace(truth(nodes=12), attenuation_np_m=losses))
    compared = known.compare(quantity="attenuation")
    np.testing.assert_allclose(compared.other, losses)
    np.testing.assert_array_equal(compared.image, result.attenuation)


def test_a_comparison_is_drawn(result: Result) -> None:
    first, second, third = result.compare().plot()
    assert [axes.get_title() for axes in (first, second)] == ["Reconstruction", "Truth"]
    assert third.get_title().startswith("Difference: ")
    assert first.get_images()[0].get_clim() == second.get_images()[0].get_clim()


def test_notebooks_show_pictures_and_escaped_words(result: Result) -> None:
    for shown in (result._repr_html_(), result.compare()._repr_html_()):
        assert '<img alt="' in shown
        assert "data:image/png;base64,iVBOR" in shown
        assert "<b>" not in shown
    assert "A &lt;b&gt;disc&lt;/b&gt;" in result._repr_html_()
    assert not plt.get_fignums(), "no figure of pyplot stays open"


def test_compressed_nifti_holds_the_image_and_hdf5_everything(result: Result, tmp_path: Path) -> None:
    packed = nibabel.load(result.save(tmp_path / "x.NII.gz", "attenuation"))
    np.testing.assert_array_equal(packed.get_fdata(), result.attenuation)
    np.testing.assert_allclose(packed.affine[:2, 3], -11.0)
    assert (tmp_path / "x.NII.gz").read_bytes()[:2] == b"\x1f\x8b"
    again = bentray.load(result.save(tmp_path / "x.h5"))
    for name, array in result.values.items():
        np.testing.assert_array_equal(again.values[name], array)
    assert (again.settings, again.history, again.trials) == (result.settings, result.history, result.trials)
    cube = volume(np.arange(27, dtype=np.float32).reshape(3, 3, 3))
    np.testing.assert_array_equal(
        bentray.load(cube.save(tmp_path / "cube.h5")).values["value"], cube.values["value"]
    )


def test_what_cannot_be_saved_is_named(result: Result, tmp_path: Path) -> None:
    for words, said in (
        (("image.tif",), r"a name ending in \.h5, \.hdf5, \.npy, \.nii, \.nii\.gz, \.nrrd, .*\.dcm$"),
        (("none/image.nii",), r"path: found .*\(its folder does not exist\)"),
        (("image.nii", "density"), "quantity: found 'density'; accepted: one of speed, coverage"),
    ):
        with pytest.raises(bentray.InvalidInput, match=said):
            result.save(tmp_path / words[0], *words[1:])
    with pytest.raises(bentray.InvalidInput, match="Np/m, which HDF5 results hold"):
        result.save(tmp_path / "x.h5", attenuation="dB/cm/MHz")
    with pytest.raises(bentray.InvalidInput, match="no such file"):
        bentray.load(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_scan_is_no_result_and_is_told_who_reads_it(tmp_path: Path) -> None:
    bentray.simulate(elements=4, nodes=16, progress=False).save(tmp_path / "scan.h5")
    with pytest.raises(bentray.InvalidInput, match=r"this is a scan, for bentray\.read"):
        bentray.load(tmp_path / "scan.h5")


def test_xarray_finds_a_place(result: Result) -> None:
    data = result.to_xarray()
    assert data.speed.dims == ("x", "y")
    assert (data.speed.attrs, data.x.attrs) == ({"units": "m/s"}, {"units": "m"})
    assert float(data.speed.sel(x=-0.011, y=0.011, method="nearest")) == result.speed[0, -1]


def test_missing_xarray_is_reported(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(bentray.InvalidInput, match=r'pip install "bentray\[xarray\]"'):
        result.to_xarray()
