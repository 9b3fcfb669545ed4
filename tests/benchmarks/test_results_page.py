"""The results page and README agree with the recorded rows, and every missed goal is on the page."""

import re

import pytest
from benchmarks.shared._results_page import (
    PAGE,
    ROOT,
    agrees,
    claims,
    contradictions,
    recorded,
    tables,
    with_missed_goals,
)

from bentray_kernels.phantoms import table6
from bentray_service.cli.output.benchmark_row import Row

# Rows about errors of images.
IMAGES = re.compile(
    r"R[1-378] |R9 .*(image|inside)|R4 |R10 |R6 (unseen|rmse)|R5 \d+² by|A[123] .*(error|time)|Figure 3[123] "
)
# The default settings take minutes of a core for each of its slices, and were not measured.
WITHOUT_DEFAULT = "R9 "

# Where the figures of README are recorded: scan to (file, label, column of the error).
README = {
    "2-D breast phantom, exact (Eikonal) times, medium 1375 m/s": (
        ("reconstruction", "R1 rms error, SART", "bent rays"),
    ),
    "the same phantom, waves of 500 kHz, water 1500 m/s, SNR 30": (
        ("acquisition_rays", "R4 simulated 500 kHz, 120 mm, SNR 30, SART, bent over straight", "bent rays"),
        ("acquisition_waveform", "R10 simulated 500 kHz, over straight SART", "`waveform`"),
    ),
    "breast with skin, 400 kHz, simulated by another team": (
        ("acquisition_rays", "R4 ring_wave_a 400 kHz, SART, bent over straight", "bent rays"),
        ("acquisition_waveform", "R10 ring_wave_a 400 kHz, over straight SART", "`waveform`"),
    ),
    "measured ring phantom": (("acquisition_rays", "R7 open-UST, SART, bent over straight", "bent rays"),),
}
README_BASELINES = {
    "best constant": "best constant",
    "straight rays": "straight rays",
    "default (`auto`)": "default settings",
}

ROWS = recorded()
TEXT = PAGE.read_text()


def test_the_tables_of_the_page_agree_with_the_recorded_rows() -> None:
    stated = list(claims(TEXT))
    assert len(stated) > 50
    wrong = [line for claim in stated for line in contradictions(claim, ROWS)]
    assert not wrong, "\n".join(wrong)


def test_every_missed_goal_is_on_the_page() -> None:
    assert with_missed_goals(TEXT, ROWS) == TEXT, "run python -m benchmarks.shared._results_page"
    for of_file in ROWS.values():
        for target, row in of_file.items():
            assert row["met"] or f"\n| {target} | " in TEXT


@pytest.mark.parametrize("file", ROWS)
def test_recorded_rows_are_met_by_the_rule_of_today(file: str) -> None:
    for row in ROWS[file].values():
        kept = {name: value for name, value in row.items() if name not in ("met", "measured")}
        value = float("nan") if row["value"] is None else row["value"]
        kept["baselines"] = {
            name: float("nan") if value is None else value for name, value in row.get("baselines", {}).items()
        }
        assert Row(**(kept | {"value": value})).met is row["met"], row["target"]


def test_image_errors_of_the_goals_have_their_baselines() -> None:
    beside = {"best constant", "water alone", "straight rays", "default settings"}
    bare = [
        f"{file}: {target}"
        for file, of_file in ROWS.items()
        for target, row in of_file.items()
        if IMAGES.match(target)
        and row["value"] is not None
        and not beside - ({"default settings"} if target.startswith(WITHOUT_DEFAULT) else set())
        <= set(row.get("baselines", ()))
    ]
    assert not bare, "\n".join(bare)


def test_the_errors_in_readme_agree_with_the_recorded_rows() -> None:
    scans = {
        line["scan"]: line
        for table in tables((ROOT / "README.md").read_text())
        for line in table
        if "best constant" in line
    }
    assert set(scans) == set(README)
    slowest, fastest = table6(1375.0).speed_range()
    for scan, sources in README.items():
        for number, (file, target, column) in enumerate(sources):
            row = ROWS[file][target]
            unit = fastest - slowest if row["unit"] == "of range" else 1.0
            errors = {column: row["error"]}
            if number == 0:
                errors |= {name: row["baselines"][value] for name, value in README_BASELINES.items()}
            for name, error in errors.items():
                assert agrees(scans[scan][name].strip("*"), unit * error, ""), (scan, name, unit * error)
