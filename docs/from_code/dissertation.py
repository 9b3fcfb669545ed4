"""The report on the dissertation's tables and figures from the recorded rows, as its command renders it."""

import sys
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "benchmarks" / "results"


def dissertation() -> str:
    """Raw HTML with the recorded pictures."""
    # The benchmarks are a namespace package of the checkout.
    if str(ROOT) not in sys.path:
        sys.path.insert(0, str(ROOT))
    parts, report, page = (
        import_module(f"benchmarks.dissertation.{name}") for name in ("_parts", "_report", "_page")
    )
    made = report.report_of(parts.recorded_parts(RESULTS), quick=False, cluster=parts.RECORDED, recorded=True)
    html = page.fragment(made, lambda benchmark, name: RESULTS / name)
    return f"```{{raw}} html\n{html}\n```"
