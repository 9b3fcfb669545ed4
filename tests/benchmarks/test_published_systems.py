"""Published systems: exact times and arcs of rays, readings of the update of speeds, and the page."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from benchmarks.published._published_rays import distance_from_arcs, exact_times, times_of
from benchmarks.published._speed_updates import readings, stretched

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs/reference/published-systems.md").read_text()
ROWS = {
    row["target"]: row for row in json.loads((ROOT / "benchmarks/results/published_systems.json").read_text())
}
STATED = re.findall(r"^\| ([^|]+) \| ([\d.]+) \| ([\d.]+) \|$", TEXT, re.MULTILINE)


def test_times_are_those_of_the_medium():
    times = exact_times(61)
    np.testing.assert_allclose(times, times_of("accurate", 61), atol=3e-4)
    # |∇T| = 1/(1 + 4x), away from the source.
    slopes = np.hypot(*np.gradient(times, 1.0 / 60))[10:-5, 20:-5]
    speed = 1.0 + 4.0 * np.linspace(0.0, 1.0, 61)[10:-5, None]
    np.testing.assert_allclose(slopes * speed, 1.0, atol=5e-3)


def test_b_splines_follow_the_arcs_of_exact_times_better():
    times = exact_times(65)
    assert distance_from_arcs(times, "bspline") < 0.3 * distance_from_arcs(times, "differences") < 0.005


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
    lines = re.findall(r"^\| (.*coupling) \| (table6\S*) \| (.+) \|$", TEXT, re.MULTILINE)
    assert len(lines) == 6
    for start, phantom, cells in lines:
        detail = ROWS[f"{phantom}, data-driven / fixed update, initial speed {start}"]["detail"]
        assert cells.split(" | ") == re.findall(r"([\d.]+) ± ", detail)


def test_figures_are_the_recorded_ones():
    assert len(STATED) > 10
    for target, published, ours in STATED:
        row = ROWS[target]
        assert (f"{row['value']:.3g}", f"{row['goal']:.3g}") == (published, ours), target
