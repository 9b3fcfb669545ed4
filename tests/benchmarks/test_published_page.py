"""The page of published systems agrees with the recorded rows, and names settings that exist."""

import json
import re
from pathlib import Path

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
