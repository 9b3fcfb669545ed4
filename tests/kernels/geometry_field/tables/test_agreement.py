"""Agreement of the sixteen entries of a cell."""

import numpy as np

from bentray_kernels.geometry_field.tables.agreement import AGREE, APART, MIXED, NONE, agreement
from bentray_kernels.meshes.surface import surface_of

from ..shapes import dented, field_of, over_the_poles


def test_agreement_is_that_of_the_sixteen():
    field = field_of(surface_of(over_the_poles(dented(3))), 3)
    known = agreement(field)
    row, seen = 18, set()
    for entry in range(36):
        for exit_ in range(36):
            if entry % 3 == 2 or exit_ % 3 == 2:
                continue
            at = np.ix_(entry + np.array([0, 1, row, row + 1]), exit_ + np.array([0, 1, row, row + 1]))
            meets, places = field.faces[at] >= 0, field.fractions[at]
            expected = NONE if not meets.any() else MIXED
            if meets.all() and np.ptp(places) <= np.float32(APART / 3):
                expected = AGREE
            assert known[entry, exit_] == expected
            seen.add(expected)
    assert seen == {NONE, AGREE, MIXED}
