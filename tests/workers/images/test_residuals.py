"""The residuals: shares by size, and a panel whose areas are counts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bentray_kernels.tomography.result import residual_counts, residual_within
from bentray_workers.images.canvas import drawing, new_figure, to_png
from bentray_workers.images.residuals import draw_residuals

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
