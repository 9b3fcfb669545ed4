"""The comparison: a column a result, common colour bars, and the errors of `compare`."""

import numpy as np
import pytest
from matplotlib.contour import ContourSet

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography.comparison import compare
from bentray_workers.images.comparison import comparison_png

from ..files.reconstructions import made, truth
from .pixels import pixels


def two():
    return {"straight": made(height_mps=20.0), "bent": made()}


def test_it_has_a_column_a_result():
    first, both = pixels(comparison_png(truth(), {"bent": made()})), pixels(comparison_png(truth(), two()))
    assert abs(both.shape[0] - first.shape[0]) < 0.05 * first.shape[0]
    assert 1.3 * first.shape[1] < both.shape[1] < 1.7 * first.shape[1]


def test_titles_show_the_errors_of_compare(undrawn):
    true_image = truth()
    roi = np.zeros(true_image.sound_speed_mps.shape, bool)
    roi[4:22, 4:20] = True
    for given in (None, roi):
        comparison_png(true_image, two(), given)
        for name, result in two().items():
            assert f"{name.capitalize()}\n{compare(result, true_image, given).caption()}" in undrawn.words()
        compared = compare(made(), true_image, given)
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
    with pytest.raises(InvalidInput) as refused:
        comparison_png(shown, results)
    assert refused.value.field == field
