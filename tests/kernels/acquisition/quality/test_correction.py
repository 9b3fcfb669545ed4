"""Corrections: exchanged channels and the pairs of an element, among emissions or among receptions."""

from dataclasses import replace

import numpy as np
import pytest

from bentray_kernels.acquisition.quality.correction import exchange_order, pairs_of
from bentray_kernels.acquisition.quality.finding import Finding

from ..traces import scan

# Elements in another order among emissions than among receptions, and fewer of them.
SCAN = replace(scan(elements=6), waveform=None, tx=np.array([4, 0, 5, 2]), rx=np.array([1, 2, 3, 4, 5]))


def finding(role, *elements):
    return Finding("swapped", "", "", "corrected", elements=elements, role=role)


@pytest.mark.parametrize(
    ("role", "axis", "order"), [("emission", 0, [3, 1, 2, 0]), ("reception", 1, [0, 3, 2, 1, 4])]
)
def test_two_channels_are_exchanged_where_they_are(role, axis, order):
    result, along = exchange_order(SCAN, finding(role, 2, 4))
    assert (result.tolist(), along) == (order, axis)


def test_pairs_of_an_element_are_its_row_or_its_column():
    rows, columns = (pairs_of(SCAN, finding(role, 4, 5)) for role in ("emission", "reception"))
    assert np.array_equal(rows, np.isin(SCAN.tx, (4, 5))[:, None] & np.ones(5, bool))
    assert np.array_equal(columns, np.ones((4, 1), bool) & np.isin(SCAN.rx, (4, 5)))
