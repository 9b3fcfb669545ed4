"""Record of a dataset for the database, in plain values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bentray_kernels.acquisition.impossible_times import impossible_words

from .counts import DatasetCounts

if TYPE_CHECKING:
    from bentray_kernels.acquisition.dataset import Dataset

LONGEST_TEXT = 200


def record_of(dataset: Dataset) -> dict[str, Any]:
    """Fields of the record by name; ``counts`` is for plans."""
    return {
        "title": text(dataset.title),
        "source": text("; ".join(note for note in (left_out(dataset), dataset.source) if note)),
        "license": text(dataset.license),
        "dimension": int(dataset.element_position_m.shape[1]),
        "elements": len(dataset.element_position_m),
        "ntx": len(dataset.tx),
        "nrx": len(dataset.rx),
        "slices": dataset.slices,
        "has_traces": dataset.waveform is not None,
        "has_travel_times": dataset.picked,
        "has_truth": dataset.truth is not None,
        "water_speed_mps": float(dataset.water_speed_mps),
        "counts": DatasetCounts.from_dataset(dataset).to_dict(),
    }


def left_out(dataset: Dataset) -> str:
    """Values that became missing, in words; empty for none."""
    words = impossible_words(dataset.impossible_times)
    return f"impossible times left out: {words}" if words else ""


def text(value: str) -> str:
    """A text of a file, printable and truncated."""
    return "".join(c for c in value if c.isprintable())[:LONGEST_TEXT]
