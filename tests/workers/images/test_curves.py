"""The curves: plain numbers on a logarithmic axis, and a scale that fits."""

from __future__ import annotations

import numpy as np
import pytest

from bentray_kernels.tomography import Sweep
from bentray_workers.images.canvas import drawing, new_figure, to_png
from bentray_workers.images.curves import draw_history


def axis(*residuals_s: float):
    with drawing():
        figure = new_figure(3.0, 3.0)
        axes = figure.subplots()
        draw_history(axes, {"one": tuple(Sweep(0, n, r, 4) for n, r in enumerate(residuals_s, start=1))})
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
        draw_history(axes, {"one": (Sweep(0, 1, 3e-9, 4), Sweep(1, 1, 4e-9, 4))})
    np.testing.assert_allclose(axes.lines[0].get_ydata(), [np.sqrt(12.5)])
