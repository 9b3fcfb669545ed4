"""The quality report of a dataset file: what was found, and a page about it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.quality import examine

from .dataset_file import read_dataset
from .images.quality_page import quality_png


@dataclass(frozen=True)
class Quality:
    """What a scan's examination gives.

    Attributes:
        report: plain values for JSON, see ``acquisition.quality.Report``.
        page: PNG about the slice with the most findings.
        picked: what goes on, with travel times; None for a refused scan.
    """

    report: dict[str, Any]
    page: bytes
    picked: Dataset | None


def examine_file(path: Path, picker: str = "aic") -> Quality:
    """Examine a dataset file.

    Raises:
        InvalidInput: from the file, or for an unknown picker.
    """
    dataset = read_dataset(path)
    examined = examine(dataset, picker)
    of_slices = [f.slice for f in examined.report.findings]
    worst = max(set(of_slices), key=of_slices.count, default=0)
    return Quality(examined.report.to_dict(), quality_png(dataset, examined, worst), examined.picked)


def quality_report(path: Path, picker: str) -> dict[str, Any]:
    """Task: the report alone."""
    return examine_file(path, picker).report


def quality_page(path: Path, picker: str) -> bytes:
    """Task: the page alone."""
    return examine_file(path, picker).page
