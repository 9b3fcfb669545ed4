"""Readings of the data-driven update: stretched ranges, and the recorded rows on the page."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from benchmarks.published._speed_updates import readings, stretched

ROOT = Path(__file__).parents[2]


def test_values_of_a_region_are_stretched_to_a_range():
    values, where = np.array([1.0, 2.0, 4.0, 9.0]), np.array([True, True, True, False])
    np.testing.assert_allclose(stretched(values, where, 10.0, 40.0), [10.0, 20.0, 40.0, 9.0])
    np.testing.assert_array_equal(stretched(np.full(4, 3.0), where, 10.0, 40.0), 3.0)


def test_readings_differ_in_where_and_when_they_stretch():
    slowness = 1.0 / np.array([1000.0, 1200.0, 1400.0, 1500.0])
    inside, region = np.array([False, True, True, False]), np.array([True, True, True, False])
    images = readings(inside, 1300.0, 1700.0)
    for name, reading in images.items():
        first, later = (reading(slowness, region, warm) for warm in (False, True))
        assert later[3] == pytest.approx(1500.0)
        assert np.allclose(first, 1.0 / slowness) == (name != "from the first emitter")
        ends = {"fixed": (1000.0, 1400.0), "range of the object alone": (1000.0, 1700.0)}
        np.testing.assert_allclose(later[[0, 2]], ends.get(name, (1300.0, 1700.0)))
    assert images["range of slowness"](slowness, region, True)[1] != pytest.approx(1500.0)


def test_the_page_states_the_recorded_errors():
    page = (ROOT / "docs/reference/published-systems.md").read_text()
    rows = json.loads((ROOT / "benchmarks/results/published_systems.json").read_text())
    details = {row["target"]: row["detail"] for row in rows}
    lines = re.findall(r"^\| (.*coupling) \| (table6\S*) \| (.+) \|$", page, re.MULTILINE)
    assert len(lines) == 6
    for start, phantom, cells in lines:
        detail = details[f"{phantom}, data-driven / fixed update, initial speed {start}"]
        assert cells.split(" | ") == re.findall(r"([\d.]+) ± ", detail)
