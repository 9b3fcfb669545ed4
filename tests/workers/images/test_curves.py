"""The curves: plain numbers on a logarithmic axis, and a scale that fits."""

import numpy as np
import pytest

from bentray_kernels.tomography import Iteration
from bentray_workers.images.canvas import drawing, new_figure, to_png
from bentray_workers.images.curves import draw_history


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
