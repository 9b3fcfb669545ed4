"""Emissions are picked in batches, each once."""

import pytest

from bentray_workers.reconstruction.picking_batches import batches_of


@pytest.mark.parametrize(("emissions", "samples"), [(1, 1), (7, 4_000_000), (256, 10**9), (100, 0)])
def test_batches_are_all_emissions_in_order(emissions, samples):
    batches = batches_of(emissions, samples)
    assert [e for batch in batches for e in batch] == list(range(emissions))
