"""Names of the pickers, and the default; without an import of their compiled code."""

from __future__ import annotations

from typing import Literal

PickerName = Literal["aic", "threshold", "energy-ratio", "sta-lta", "correlation", "matched"]

DEFAULT_PICKER: PickerName = "aic"
