"""The recorded report on the dissertation's tables and figures, rendered as by the command that writes it."""

from __future__ import annotations

import json
import sys
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "benchmarks" / "results"


def dissertation() -> str:
    """Raw HTML; with pictures only for a full run, whose pictures are the recorded ones."""
    # The benchmarks are a namespace package of the checkout.
    if str(ROOT) not in sys.path:
        sys.path.insert(0, str(ROOT))
    fragment = import_module("benchmarks.dissertation._page").fragment
    report = json.loads((RESULTS / "dissertation.json").read_text())
    html = fragment(report, lambda benchmark, name: None if report["quick"] else RESULTS / name)
    return f"```{{raw}} html\n{html}\n```"
