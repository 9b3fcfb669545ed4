"""One thing that a check found in a scan, and the report of all of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ...arrays import Flags

Action = Literal["left out", "corrected", "refused", "reported"]
Role = Literal["emission", "reception", ""]

# Pairs that a report names one by one; of the others it gives the number.
MOST_NAMED = 20

# What a line of no findings says.
NOTHING_FOUND = "nothing found"

# Findings that a line tells, and elements of each.
MOST_TOLD = 8


@dataclass(frozen=True)
class Finding:
    """What a check found.

    Attributes:
        check: its name.
        found: in words.
        accepted: what would have passed, in words.
        action: what is done: pairs are left out, the data corrected, the scan refused, or nothing.
        elements: indices of the elements at fault.
        role: in which they are, where it is one of the two.
        pairs: (ntx, nrx), those at fault; None where whole elements or the whole scan are.
        value: the figure that decided, in ``unit``; NaN where there is none.
        slice: axial index.
    """

    check: str
    found: str
    accepted: str
    action: Action
    elements: tuple[int, ...] = ()
    role: Role = ""
    pairs: Flags | None = field(default=None, repr=False)
    value: float = math.nan
    unit: str = ""
    slice: int = 0

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; of the pairs, as (emission, reception), the first few and the number."""
        told: dict[str, Any] = {
            "check": self.check,
            "found": self.found,
            "accepted": self.accepted,
            "action": self.action,
            "slice": self.slice,
            "elements": list(self.elements),
            "role": self.role,
            "value": self.value if math.isfinite(self.value) else None,
            "unit": self.unit,
        }
        if self.pairs is not None:
            where = np.argwhere(self.pairs)
            told["pair_count"] = len(where)
            told["first_pairs"] = where[:MOST_NAMED].tolist()
        return told


@dataclass(frozen=True)
class Report:
    """All findings of a scan, in the order of the checks.

    Attributes:
        findings: none where nothing is wrong.
        checked: names of the checks that were made; what the scan does not hold cannot be checked.
        pairs: pairs of different elements, over all slices.
        usable: those that go on.
        picker: what read the times, empty where they came with the scan.
    """

    findings: tuple[Finding, ...]
    checked: tuple[str, ...]
    pairs: int
    usable: int
    picker: str = ""

    @property
    def refusal(self) -> Finding | None:
        """The first finding that stops the scan, if one does."""
        return next((f for f in self.findings if f.action == "refused"), None)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "verdict": self.verdict,
            "pairs": self.pairs,
            "usable_pairs": self.usable,
            "picker": self.picker,
            "checked": list(self.checked),
            "findings": [finding.to_dict() for finding in self.findings],
        }

    @property
    def verdict(self) -> str:
        """``clean``, ``usable`` with what was found, or ``refused``."""
        if self.refusal is not None:
            return "refused"
        return "usable" if self.findings else "clean"


def words(findings: Sequence[Finding], *, stacked: bool = False) -> str:
    """Findings in one line: what, of which elements, and what was done.

    Args:
        findings: none gives a line too.
        stacked: whether to say of which slice each is.
    """
    if not findings:
        return NOTHING_FOUND
    lines = []
    for finding in findings[:MOST_TOLD]:
        where = f"slice {finding.slice}: " if stacked else ""
        more = ", …" if len(finding.elements) > MOST_TOLD else ""
        of = f" ({', '.join(map(str, finding.elements[:MOST_TOLD]))}{more})" if finding.elements else ""
        lines.append(f"{where}{finding.check}: {finding.found}{of}, {finding.action}")
    others = len(findings) - len(lines)
    return "; ".join(lines) + (f"; and {others} more" if others else "")
