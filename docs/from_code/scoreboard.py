"""Table of the scoreboard, from its recorded rows."""

import json
from pathlib import Path

from .tables import table

ROWS = Path(__file__).resolve().parents[2] / "benchmarks" / "results" / "scoreboard.json"
FIGURES = {"RMSE": "RMSE, m/s", "MAE": "MAE, m/s", "SSIM": "SSIM", "PCC": "PCC", "seconds": "s"}
BASELINES = ("best constant", "water alone", "straight rays")


def scoreboard(file: Path = ROWS) -> str:
    """One row for each object and method, with the RMSE of the baselines; bold where a goal is missed."""
    rows = []
    for row in json.loads(file.read_text()):
        if "figures" not in row:
            continue
        name, _, method = row["target"].removesuffix(": RMSE").rpartition(", ")
        figures = [_rounded(key, row["figures"][key]) for key in FIGURES]
        if not row["met"]:
            figures[0] = f"**{figures[0]}**"
        rows.append((name, method, *figures, *(f"{row['baselines'][one]:.1f}" for one in BASELINES)))
    return table(("object", "method", *FIGURES.values(), *BASELINES), rows)


def _rounded(name: str, value: float | None) -> str:
    if value is None:
        return "none"
    return (
        f"{value:.0f}" if name == "seconds" else f"{value:.3f}" if name in ("SSIM", "PCC") else f"{value:.1f}"
    )
