"""Curves, residuals and comparisons: axes, stages, shares, errors and colours."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.contour import ContourSet

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Iteration
from bentray_kernels.tomography.comparison import compare
from bentray_kernels.tomography.result import residual_counts, residual_within
from bentray_workers.images.canvas import drawing, new_figure, to_png
from bentray_workers.images.comparison import comparison_png
from bentray_workers.images.curves import draw_history
from bentray_workers.images.residuals import draw_residuals

from ..files.reconstructions import made, truth
from ..pixels import pixels_of


def axis(*residuals_s: float):
    with drawing():
        figure = new_figure(3.0, 3.0)
        axes = figure.subplots()
        draw_history(axes, {"one": tuple(Iteration(0, n, r, 4) for n, r in enumerate(residuals_s, start=1))})
        to_png(figure)
    return axes


def test_a_wide_range_is_drawn_on_a_logarithmic_axis_with_plain_numbers():
    axes = axis(6e-7, 4e-8, 1.1e-8)
    assert axes.get_yscale() == "log"
    low, high = axes.get_ylim()
    labels = [
        label.get_text()
        for place, label in zip(axes.get_yticks(), axes.get_yticklabels(), strict=True)
        if low <= place <= high
    ]
    assert {"20", "100", "500"} <= set(labels)
    assert all(float(label) > 0 for label in labels)


@pytest.mark.parametrize("residuals", [(2e-7, 1e-7), (1e-7, 0.0), (0.0,), ()])
def test_any_other_begins_at_zero(residuals):
    axes = axis(*residuals)
    assert axes.get_yscale() == "linear"
    assert axes.get_ylim()[0] == 0.0


def test_over_slices_it_is_the_root_mean_square():
    with drawing():
        axes = new_figure(3.0, 3.0).subplots()
        draw_history(axes, {"one": (Iteration(0, 1, 3e-9, 4), Iteration(1, 1, 4e-9, 4))})
    np.testing.assert_allclose(axes.lines[0].get_ydata(), [np.sqrt(12.5)])


def staged(names: tuple[str, ...]):
    history = (
        *(Iteration(k, n, 8e-7, 4, 0) for n in (1, 2, 3) for k in (0, 1)),
        Iteration(0, 1, 3e-7, 4, 1),
        Iteration(1, 1, 4e-7, 4, 1),
        Iteration(1, 2, 2e-7, 4, 1),
    )
    with drawing():
        axes = new_figure(3.0, 3.0).subplots()
        draw_history(axes, {"one": history}, names)
    return axes


def test_stages_follow_each_other_with_a_dotted_line_between():
    first, second, border = staged(("32 nodes", "64 nodes")).lines
    np.testing.assert_array_equal(first.get_xdata(), [1, 2, 3])
    np.testing.assert_array_equal(second.get_xdata(), [4, 5])
    np.testing.assert_allclose(second.get_ydata(), [np.sqrt(12.5) * 100, 200])
    assert list(border.get_xdata()) == [3.5, 3.5]
    assert border.get_linestyle() == ":"


def test_the_names_of_stages_stand_above_their_sweeps_and_the_curve_keeps_clear():
    axes = staged(("32 nodes", "64 nodes"))
    assert [(text.get_text(), text.get_position()[0]) for text in axes.texts] == [
        ("32 nodes", 2.0),
        ("64 nodes", 4.5),
    ]
    assert axes.get_ylim()[1] >= 1.2 * 800
    assert staged(()).get_ylim()[1] < 1.2 * 800


def test_a_legend_names_each_history_once():
    stages = tuple(Iteration(0, 1, 1e-7, 4, stage) for stage in (0, 1))
    with drawing():
        axes = new_figure(3.0, 3.0).subplots()
        draw_history(axes, {"straight": stages, "bent": stages})
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["straight", "bent"]


sizes_s = st.floats(1e-11, 9e-5)


@given(st.lists(sizes_s, min_size=1), st.floats(0.01, 1.0))
def test_reported_share_lies_within_the_reported_limit(found: list[float], share: float) -> None:
    residuals = np.array(found) * np.where(np.arange(len(found)) % 2, 1.0, -1.0)
    size = residual_within(residual_counts(residuals), share)
    # A bin is a third wide, and the one around zero a tenth of a nanosecond.
    assert np.mean(np.abs(residuals) <= 1.34 * size + 1e-10) >= share - 1e-9
    assert np.mean(np.abs(residuals) < size / 1.34 - 1e-10) <= share + 1e-9


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.floats(3e-9, 1e-6))
def test_shares_of_gaussian_residuals_are_those_of_its_quantiles(seed: int, sigma_s: float) -> None:
    counts = residual_counts(np.random.default_rng(seed).normal(0.0, sigma_s, 20_000))
    for share, quantile in ((0.5, 0.6745), (0.9, 1.645), (0.99, 2.576)):
        assert residual_within(counts, share) == pytest.approx(quantile * sigma_s, rel=0.1)


def test_without_residuals_the_size_is_zero() -> None:
    assert residual_within(residual_counts(np.array([])), 0.9) == 0.0


def panel(residuals_s: np.ndarray, rms_s: float | None = None):
    with drawing():
        figure = new_figure(3.0, 3.0)
        axes = figure.subplots()
        draw_residuals(axes, residual_counts(residuals_s), rms_s)
        to_png(figure)
    return axes


def test_the_areas_of_the_bars_as_they_are_seen_are_the_counts() -> None:
    residuals = np.random.default_rng(1).normal(0.0, 40e-9, 5000)
    residuals[:50] *= 30.0
    axes = panel(residuals, 50e-9)
    values, edges, _ = axes.patches[0].get_data()
    seen = axes.transData.transform(np.column_stack((edges, np.zeros(edges.size))))[:, 0]
    areas = values * np.diff(seen)
    counts = np.histogram(residuals, 1e-9 * edges)[0]
    np.testing.assert_allclose(areas / areas.sum(), counts / counts.sum(), atol=1e-9)


def test_it_says_the_rms_and_marks_it(drawn) -> None:
    axes = panel(np.random.default_rng(1).normal(0.0, 40e-9, 5000), 41.2e-9)
    assert "Residuals, 41.2 ns rms" in drawn.words()
    assert [line.get_xdata()[0] for line in axes.lines] == pytest.approx([-41.2, 41.2])
    assert axes.get_xlabel() == "measured minus predicted (ns)\nhalf within 27, 95 % within 81 ns"


@pytest.mark.parametrize("scale_s", [1e-11, 1e-9, 5e-6, 1e-3])
def test_the_ticks_are_few_and_lie_on_the_axis(scale_s: float) -> None:
    axes = panel(np.random.default_rng(1).normal(0.0, scale_s, 500))
    low, high = axes.get_xlim()
    ticks = axes.get_xticks()
    assert 3 <= len(ticks) <= 7
    assert low <= ticks.min() < 0.0 < ticks.max() <= high


def test_empty_data_draw_an_empty_panel() -> None:
    assert panel(np.array([])).get_title(loc="left") == "Residuals"


def two():
    return {"straight": made(height_mps=20.0), "bent": made()}


def test_it_has_a_column_a_result():
    first, both = (
        pixels_of(comparison_png(truth(), {"bent": made()})),
        pixels_of(comparison_png(truth(), two())),
    )
    assert abs(both.shape[0] - first.shape[0]) < 0.05 * first.shape[0]
    assert 1.3 * first.shape[1] < both.shape[1] < 1.7 * first.shape[1]


def test_titles_show_the_errors_of_compare(undrawn):
    true_image = truth()
    roi = np.zeros(true_image.sound_speed_mps.shape, bool)
    roi[4:22, 4:20] = True
    for region in (None, roi):
        comparison_png(true_image, two(), region)
        for name, result in two().items():
            assert f"{name.capitalize()}\n{compare(result, true_image, region).caption()}" in undrawn.words()
        compared = compare(made(), true_image, region)
        assert f"Errors in: {compared.region_choice}" in undrawn.words()
        constant = float(compared.other[compared.region].std())
        assert f"Phantom\nbest constant: {constant:.1f} m/s rms" in undrawn.words()


def test_speeds_share_one_bar_and_differences_another(undrawn):
    comparison_png(truth(), two())
    assert undrawn.words().count("sound speed (m/s)") == 1
    assert undrawn.words().count("difference (m/s)") == 1
    maps = [axes for axes in undrawn[-1].axes if axes.images]
    limits = {axes.get_title(loc="left"): axes.images[0].get_clim() for axes in maps}
    assert len(limits) == 5
    assert len(set(limits.values())) == 2


def test_the_region_is_outlined_in_every_map(undrawn):
    comparison_png(truth(), two())
    outlined = [axes for axes in undrawn[-1].axes if axes.images and axes.findobj(ContourSet)]
    assert len(outlined) == 5


@pytest.mark.parametrize(
    ("results", "shown", "field"),
    [({}, truth(), "results"), ({"bent": made()}, truth(axes="as displayed"), "truth")],
)
def test_it_needs_results_and_a_truth_that_fits(results, shown, field):
    with pytest.raises(InvalidInput, match=f"^{field}: "):
        comparison_png(shown, results)
