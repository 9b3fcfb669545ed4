"""The report: its panels, the middle slice, errors, and captions without a truth."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition import Truth
from bentray_kernels.tomography import Candidate, Caution, Iteration, Reconstruction
from bentray_kernels.tomography.comparison import compare
from bentray_kernels.tomography.model_selection.selection import explain_candidates
from bentray_workers.images.report import report_png

from ..files.reconstructions import SPACING_M, made, truth
from ..pixels import pixels_of


def panels(undrawn) -> list[str]:
    return [axes.get_title(loc="left") for axes in undrawn[-1].axes if axes.get_title(loc="left")]


PLAIN = {"attenuation": None, "recovery": None, "residuals": None, "trials": ()}
ATTENUATION = "Attenuation (experimental)"
RESIDUALS = "Residuals, 33.3 ns rms"


@pytest.mark.parametrize(
    ("change", "shown"),
    [
        (PLAIN, ["Reconstruction", "Coverage", "Convergence"]),
        ({**PLAIN, "history": ()}, ["Reconstruction", "Coverage", "Convergence"]),
        (
            {"attenuation": None, "recovery": None},
            ["Reconstruction", "Coverage", "Convergence", RESIDUALS],
        ),
        ({"recovery": None}, ["Reconstruction", "Coverage", ATTENUATION, "Convergence", RESIDUALS]),
        (
            {},
            ["Reconstruction", "Coverage", "Resolution check", ATTENUATION, "Convergence", RESIDUALS],
        ),
    ],
)
def test_report_without_a_truth(undrawn, change, shown):
    result = replace(made(), history=tuple(Iteration(0, n, 1e-7 / n, 64) for n in (1, 2, 3)))
    report_png(replace(result, **change))
    assert undrawn[-1].get_figwidth() > 7.0
    assert panels(undrawn) == shown


def test_an_attenuation_no_better_than_a_constant_says_so_under_its_image(undrawn):
    report_png(
        replace(made(), cautions=(Caution("attenuation", "Not better."), Caution("bounds", "Cut off.")))
    )
    assert "x (mm)\nNot better." in undrawn.words()
    assert "x (mm)\nCut off." not in undrawn.words()


@pytest.mark.parametrize("change", [PLAIN, {}])
def test_with_a_truth_it_also_shows_difference_and_profile(undrawn, change):
    result = replace(made(), **change)
    report_png(result, truth())
    caption = f"Difference: {compare(result, truth()).caption()}"
    assert panels(undrawn)[:4] == ["Reconstruction", "Truth", caption, "Along y = 1.0 mm"]
    report_png(result)
    plain = panels(undrawn)
    report_png(result, truth())
    assert panels(undrawn)[4:] == plain[1:]


def test_each_image_has_its_own_limits_and_the_resolution_check_those_from_0_to_1(undrawn):
    report_png(made())
    maps = [axes for axes in undrawn[-1].axes if axes.images]
    limits = {axes.get_title(loc="left"): axes.images[0].get_clim() for axes in maps}
    assert limits["Resolution check"] == (0.0, 1.0)
    assert limits[ATTENUATION][1] == pytest.approx(5.0, abs=0.1)
    assert len(set(limits.values())) == 4


def test_the_uncertainty_is_a_panel_with_colours_from_zero(undrawn):
    result = replace(made(), uncertainty=np.random.default_rng(2).uniform(3.0, 9.0, made().speed.shape))
    report_png(result)
    shown = {axes.get_title(loc="left"): axes.images[0] for axes in undrawn[-1].axes if axes.images}
    low, high = shown["Uncertainty"].get_clim()
    assert low == 0.0
    assert high == pytest.approx(9.0, abs=0.1)
    # With a truth and a section there are eleven panels.
    report_png(result, truth())


def test_report_names_stages_and_automatic_choices(undrawn):
    history = (*(Iteration(0, n, 1e-7, 4, 0) for n in (1, 2)), Iteration(0, 1, 9e-8, 4, 1))
    plan = made().settings.changed(nodes=64, coarser_grids=1)
    trials = (
        Candidate({"rays": "curved", "method": "sart"}, 4e-8, 3e-8),
        Candidate({"rays": "straight", "method": "sart"}, 9e-8, 8e-8),
    )
    report_png(replace(made(), history=history, settings=plan, trials=trials))
    assert {"32 nodes", "64 nodes"} <= set(undrawn.words())
    under = " ".join(undrawn[-1].get_supxlabel().split())
    assert "3 iterations in 2 stages" in under
    assert under.endswith(explain_candidates(trials))


def test_the_errors_in_the_title_are_those_of_compare_with_their_region(undrawn):
    result, true_image = made(height_mps=20.0), truth()
    corner = np.zeros(true_image.sound_speed_mps.shape, bool)
    corner[8:20, 4:12] = True
    for roi in (None, corner):
        report_png(result, true_image, roi)
        comparison = compare(result, true_image, roi)
        assert f"Difference: {comparison.caption()}" in panels(undrawn)
        assert any(comparison.region_choice in words for words in undrawn.words())
    assert compare(result, true_image, corner).caption() != compare(result, true_image).caption()


def test_reconstruction_and_truth_share_a_colour_bar(undrawn):
    report_png(made(), truth())
    assert undrawn.words().count("sound speed (m/s)") == 2, "one bar, one profile"


def test_a_truth_that_needs_registration_is_shown_with_the_reason(undrawn):
    report_png(made(), truth(axes="as $displayed$; rotate"))
    assert panels(undrawn)[:3] == ["Reconstruction", "Truth", "Coverage"]
    assert panels(undrawn)[-2:] == ["Convergence", "Residuals, 11.1 ns rms"]
    assert "x (mm)\nnot compared: the truth must be registered with the image first" in undrawn.words()


def volume() -> Reconstruction:
    step = (SPACING_M, SPACING_M, 0.003)
    return replace(made(slices=3), spacing_m=step)


def test_of_several_slices_the_middle_one_is_shown_and_named(undrawn):
    report_png(volume())
    assert "Sound speed, slice index 1 (0 to 2), z = 13.0 mm" in undrawn.words()
    assert "Convergence, all 3 slices" in panels(undrawn)
    first = undrawn[-1].axes[0].images[0].get_array()
    for k, same in ((0, True), (1, False), (2, True)):
        speed = volume().speed
        speed[:12, :12, k] += 30.0
        report_png(replace(volume(), speed=speed))
        assert np.array_equal(undrawn[-1].axes[0].images[0].get_array(), first) is same


def test_the_errors_of_a_volume_are_those_of_all_its_slices(undrawn):
    solid = Truth(
        np.repeat(truth().sound_speed_mps[..., None], 3, axis=2),
        volume().spacing_m,
        volume().origin_m,
        axes="x,y,z",
    )
    speed = volume().speed
    speed[..., 0] += 50.0
    result = replace(volume(), speed=speed)
    report_png(result, solid)
    assert f"Difference: {compare(result, solid).caption()}" in panels(undrawn)
    assert compare(result, solid).rms > 20.0


@pytest.mark.parametrize("empty", [True, False])
def test_a_middle_slice_without_a_node_in_the_region_is_drawn(empty):
    solid = Truth(np.full((24, 24, 3), 1500.0), volume().spacing_m, volume().origin_m, axes="x,y,z")
    roi = np.zeros((24, 24, 3), bool)
    roi[5:9, 5:9, 0 if empty else 1] = True
    assert pixels_of(report_png(volume(), solid, roi)).shape[0] > 500


def test_many_even_slices_are_shown_from_the_side_too(undrawn):
    step = (SPACING_M, SPACING_M, 0.004)
    result = replace(made(slices=6), spacing_m=step, origin_m=(*made().origin_m, 0.01))
    report_png(result)
    plain = panels(undrawn)
    assert plain[:3] == ["Reconstruction", "Reconstruction, y = 1.0 mm", "Coverage"]
    section = undrawn[-1].axes[1]
    assert section.get_ylabel() == "z (mm)"
    np.testing.assert_allclose(section.images[0].get_array().T, result.speed[:, 12])
    assert section.images[0].get_extent() == pytest.approx([-24.0, 24.0, 8.0, 32.0])
    assert section.get_ylim() == pytest.approx((-4.0, 44.0)), "as high as the others"
    solid = Truth(np.full((24, 24, 6), 1500.0), step, result.origin_m, axes="x,y,z")
    report_png(result, solid)
    assert panels(undrawn)[3:] == plain[1:]


@pytest.mark.parametrize("slices", [3, 6])
def test_few_or_uneven_slices_are_not(undrawn, slices):
    report_png(volume() if slices == 3 else made(slices=slices))
    assert panels(undrawn)[1] == "Coverage"


def test_a_plain_report_is_drawn_with_every_panel():
    height, width, _ = pixels_of(report_png(made())).shape
    assert width > height > 900
