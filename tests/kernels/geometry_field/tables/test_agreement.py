"""Agreement of the sixteen entries of a cell."""

import numpy as np

from bentray_kernels.geometry_field.tables.agreement import AGREE, APART, MIXED, NONE, agreement
from bentray_kernels.geometry_field.tables.outer_field import OuterField
from bentray_kernels.meshes.surface import surface_of

from ..shapes import dented, field_of, over_the_poles


def cells():
    """Entry, exit and indices of the sixteen entries of each cell at resolution 3."""
    corners = np.array([0, 1, 18, 19])
    inner = [start for start in range(36) if start % 3 != 2]
    for entry in inner:
        for exit_ in inner:
            yield entry, exit_, np.ix_(entry + corners, exit_ + corners)


def test_agreement_is_that_of_the_sixteen():
    field = field_of(surface_of(over_the_poles(dented(3))), 3)
    agreeing = agreement(field)
    seen = set()
    for entry, exit_, at in cells():
        meets, points = field.faces[at] >= 0, field.fractions[at]
        expected = NONE if not meets.any() else MIXED
        if meets.all() and np.ptp(points) <= np.float32(APART / 3):
            expected = AGREE
        assert agreeing[entry, exit_] == expected
        seen.add(expected)
    assert seen == {NONE, AGREE, MIXED}


def test_the_lowest_and_the_highest_of_the_sixteen_decide():
    """Positions drawn at random, as far apart as the limit: about half of the cells agree."""
    n = 3
    random = np.random.default_rng(1)
    spread = np.float32(1.1 * APART / n)
    fractions = random.uniform(-1.0, -1.0 + spread, (54, 54)).astype(np.float32) + np.float32(1.0)
    agreeing = agreement(OuterField(n, np.zeros((54, 54), np.int32), fractions))
    counts = {AGREE: 0, MIXED: 0}
    for entry, exit_, at in cells():
        expected = AGREE if np.ptp(fractions[at]) <= np.float32(APART / n) else MIXED
        assert agreeing[entry, exit_] == expected
        counts[expected] += 1
    assert min(counts.values()) > 50
