"""The table of memory is what is fitted to its peaks: above each of them, and not by much."""

import json

import pytest
from benchmarks.memory.task_memory import EXCESS, SPARE_BYTES

from bentray_workers.cluster.task_costs import (
    TABLE,
    TaskSize,
    bytes_of,
    coefficients,
    largest_of,
    largest_sizes,
)

from .fitted_costs import fitted, peaks_in

PEAKS = peaks_in()

# Of the smallest scans more than half is what earlier tasks left; none is the largest task of a larger scan.
LOOSE = {"finish_slice", "read_chords"}


@pytest.mark.parametrize("kind", sorted(PEAKS))
def test_the_table_is_fitted_to_its_peaks(kind):
    assert coefficients()[kind] == pytest.approx(fitted(PEAKS[kind]), rel=1e-3)
    for peak in PEAKS[kind]:
        planned = TaskSize(kind, peak.counts).bytes
        assert peak.bytes <= planned
        assert kind in LOOSE or planned <= (1.0 + EXCESS) * peak.bytes + SPARE_BYTES, peak


def test_the_table_states_how_it_was_made():
    stated = json.loads(TABLE.read_text())
    assert set(stated["bytes"]) == set(stated["peaks"])
    assert 0.0 < stated["margin"] < EXCESS
    assert "bytes" in stated["unit"]
    assert stated["measured"] > "2026"


def test_memory_is_the_sum_of_its_terms():
    size = TaskSize("update_sart", {"images": 1e6, "data": 1e4, "rays": 0})
    assert size.bytes == sum(size.terms.values()) > size.terms["images"] > 2**20
    assert "rays" not in size.terms
    larger = TaskSize("update_sart", {"images": 2e6})
    assert largest_sizes([{"a": larger}, {"a": size, "b": size}]) == {"a": larger, "b": size}
    assert largest_of(bytes_of({"a": size, "b": larger})) == ("b", larger.bytes)
    with pytest.raises(KeyError):
        _ = TaskSize("update_sart", {"what was not measured": 1}).bytes
