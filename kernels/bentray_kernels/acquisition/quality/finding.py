"""Findings of the checks of a scan, and the report of all of them."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from ...arrays import Flags

Action = Literal["left out", "corrected", "refused", "reported"]
Role = Literal["emission", "reception", ""]
ROLES: tuple[Role, ...] = ("emission", "reception")

# Most pairs listed in a report; of the others it gives the number.
MAX_LISTED = 20

# Summary without findings.
NOTHING_FOUND = "nothing found"

# Most findings in a summary, and elements of each.
MAX_SUMMARISED = 8


@dataclass(frozen=True)
class Finding:
    """The result of a failed check.

    Attributes:
        check: its name.
        found: message.
        accepted: description of valid values.
        action: pairs are left out, the data corrected, the scan refused, or the finding only reported.
        elements: indices of the elements affected.
        role: emission or reception, if only one is affected.
        pairs: (ntx, nrx), those affected; None for whole elements or the whole scan.
        value: the deciding value, in ``unit``; NaN if there is none.
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
        """Plain values for JSON, with the number of pairs and the first of them as (emission, reception)."""
        names = ("check", "found", "accepted", "action", "slice", "elements", "role", "value", "unit")
        record: dict[str, Any] = {name: getattr(self, name) for name in names}
        record["elements"] = list(self.elements)
        record["value"] = self.value if math.isfinite(self.value) else None
        if self.pairs is not None:
            where = np.argwhere(self.pairs)
            record["pair_count"] = len(where)
            record["first_pairs"] = where[:MAX_LISTED].tolist()
        return record


@dataclass(frozen=True)
class Report:
    """All findings of a scan, in the order of the checks.

    Attributes:
        findings: empty for a valid scan.
        checked: names of the checks made; missing data cannot be checked.
        pairs: number of pairs of different elements, over all slices.
        usable: number of pairs with valid times.
        picker: method of the times, empty where they came with the scan.
        not_checked: reasons why a check does not apply to the array, by its name.
    """

    findings: tuple[Finding, ...]
    checked: tuple[str, ...]
    pairs: int
    usable: int
    picker: str = ""
    not_checked: Mapping[str, str] = field(default_factory=dict)

    @property
    def refusal(self) -> Finding | None:
        """The first finding that rejects the scan, if any."""
        return next((f for f in self.findings if f.action == "refused"), None)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "verdict": self.verdict,
            "pairs": self.pairs,
            "usable_pairs": self.usable,
            "picker": self.picker,
            "checked": list(self.checked),
            "not_checked": dict(self.not_checked),
            "findings": [finding.to_dict() for finding in self.findings],
        }

    @property
    def verdict(self) -> str:
        """``clean``, ``usable`` with findings, or ``refused``."""
        if self.refusal is not None:
            return "refused"
        return "usable" if self.findings else "clean"


def left_out(findings: Iterable[Finding], shape: tuple[int, ...]) -> Flags:
    """Pairs that findings leave out, of this shape."""
    pairs = np.zeros(shape, dtype=bool)
    for finding in findings:
        if finding.action == "left out" and finding.pairs is not None:
            pairs |= finding.pairs
    return pairs


def words(findings: Sequence[Finding], *, stacked: bool = False) -> str:
    """Summarise findings in one line: check, elements, action.

    Args:
        findings: may be empty.
        stacked: whether to name the slice of each.
    """
    if not findings:
        return NOTHING_FOUND
    lines = []
    for finding in findings[:MAX_SUMMARISED]:
        where = f"slice {finding.slice}: " if stacked else ""
        more = ", …" if len(finding.elements) > MAX_SUMMARISED else ""
        of = f" ({', '.join(map(str, finding.elements[:MAX_SUMMARISED]))}{more})" if finding.elements else ""
        lines.append(f"{where}{finding.check}: {finding.found}{of}, {finding.action}")
    others = len(findings) - len(lines)
    return "; ".join(lines) + (f"; and {others} more" if others else "")
