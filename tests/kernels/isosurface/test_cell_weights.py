"""Weights over a cell: their extremes, their Bernstein form, and how many nodes act."""

import numpy as np
import pytest
from numpy.polynomial import polynomial

from bentray_kernels.isosurface.cell_weights import CellWeights, cell_weights
from bentray_kernels.splines.filters import FILTERS


def dense(weights: CellWeights, points: np.ndarray) -> np.ndarray:
    """(nodes, places) weights at places of the cell."""
    pieces = len(weights.powers)
    number = np.minimum((points * pieces).astype(int), pieces - 1)
    values = [polynomial.polyval(points * pieces - k, weights.powers[k].T) for k in range(pieces)]
    return np.choose(number, values)


@pytest.mark.parametrize("name", sorted(FILTERS))
@pytest.mark.parametrize("divisions", [1, 2, 3])
def test_the_extremes_of_each_part(name, divisions):
    weights = cell_weights(FILTERS[name])
    low, high = weights.ranges(divisions)
    for part in range(divisions):
        values = dense(weights, np.linspace(part, part + 1, 2001) / divisions)
        np.testing.assert_allclose(low[part], values.min(axis=1), atol=1e-5)
        np.testing.assert_allclose(high[part], values.max(axis=1), atol=1e-5)
        assert (low[part] <= values.min(axis=1) + 1e-15).all()
        assert (high[part] >= values.max(axis=1) - 1e-15).all()


@pytest.mark.parametrize("name", sorted(FILTERS))
def test_the_sum_of_absolute_weights(name):
    weights = cell_weights(FILTERS[name])
    values = dense(weights, np.linspace(0.0, 1.0, 2001))
    np.testing.assert_allclose(values.sum(axis=0), 1.0)
    assert weights.total() == pytest.approx(np.abs(values).sum(axis=0).max(), abs=1e-6)


@pytest.mark.parametrize(
    ("name", "first", "nodes"),
    [
        ("trilinear", 0, 2),
        ("central", 0, 2),
        ("catmull-rom", -1, 4),
        ("bspline2", -1, 4),
        ("bspline3", -1, 4),
    ],
)
def test_the_nodes_that_act_on_a_cell(name, first, nodes):
    weights = cell_weights(FILTERS[name])
    assert (weights.first, weights.nodes) == (first, nodes)


@pytest.mark.parametrize("name", sorted(FILTERS))
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_the_bernstein_form_ends_at_the_weights_and_holds_them(name, derivative):
    weights = cell_weights(FILTERS[name])
    control = weights.control(derivative)
    pieces = len(weights.powers)
    rows = len(control) // pieces
    for k, powers in enumerate(weights.powers):
        derived = polynomial.polyder(powers, derivative, axis=1) * float(pieces) ** derivative
        values = polynomial.polyval(np.linspace(0.0, 1.0, 101), derived.T)
        part = control[k * rows : (k + 1) * rows]
        np.testing.assert_allclose([part[0], part[-1]], [values[:, 0], values[:, -1]], atol=1e-12)
        assert (part.min(axis=0) <= values.min(axis=1) + 1e-12).all()
        assert (part.max(axis=0) >= values.max(axis=1) - 1e-12).all()
