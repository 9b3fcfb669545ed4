"""The page of published systems agrees with the recorded rows, and names settings that exist."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from bentray_kernels.request_fields import choices_of
from bentray_kernels.tomography import AttenuationSettings, Settings
from bentray_workers.rendering.field_view import FieldView
from bentray_workers.rendering.refraction_view import RefractionView
from bentray_workers.simulation.request import PhantomScan

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs/reference/published-systems.md").read_text()
ROWS = {
    row["target"]: row for row in json.loads((ROOT / "benchmarks/results/published_systems.json").read_text())
}
STATED = re.findall(r"^\| ([^|]+) \| ([\d.]+) \| ([\d.]+) \|$", TEXT, re.MULTILINE)


def test_figures_are_the_recorded_ones():
    assert len(STATED) > 10
    for target, published, ours in STATED:
        row = ROWS[target]
        assert (f"{row['value']:.3g}", f"{row['goal']:.3g}") == (published, ours), target


@pytest.mark.parametrize(
    ("word", "choices"),
    [
        ("warped-checkerboard", choices_of(RefractionView)["backdrop"]),
        ("uv-linear", choices_of(FieldView)["lookup"]),
        ("fmm-first-order", choices_of(Settings)["eikonal"]),
        (
            "attenuation_solver=sart",
            ["attenuation_solver=" + one for one in choices_of(AttenuationSettings)["attenuation_solver"]],
        ),
        ("table6-vertical", choices_of(PhantomScan)["phantom"]),
    ],
)
def test_settings_exist(word, choices):
    assert word in TEXT
    assert word in choices


@pytest.mark.parametrize(
    ("chapter", "pictures"),
    [
        (3, ("figure7", "figure8", "figure9")),
        (4, tuple(f"figure{number}" for number in range(17, 23))),
        (5, ("figure25", "figure26", "figure27")),
        (6, ("chapter6",)),
    ],
)
def test_figures_of_a_chapter_are_recorded_as_rows(chapter, pictures):
    results = ROOT / "benchmarks/results"
    assert all((results / f"{name}.png").exists() for name in pictures)
    assert json.loads((results / f"chapter{chapter}.json").read_text())
