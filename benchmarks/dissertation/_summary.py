"""Table of chapters 6 and 7: published, best peer, constant, straight rays, ours by default and tuned."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

# Rows in the form of ``Row.to_dict``: benchmark, label, row.
AllRows = Mapping[str, Mapping[str, Mapping[str, Any]]]

# From the worst.
VERDICTS = NOT_REACHED, REPRODUCED, BETTER = "not reached", "reproduced", "better"


@dataclass(frozen=True)
class Case:
    """A line of the table.

    Attributes:
        name: for the reader.
        benchmark: of the rows.
        default: label of the row by default settings.
        tuned: label of the row by tuned settings; empty: there is none.
        published: figure in the unit of the rows; None: not published.
        straight: published figure of straight rays.
        peers: beginning of the labels of peers, whose values are their errors over ours.
        value: whether the value of a row is shown, in place of its error.
    """

    name: str
    benchmark: str
    default: str
    tuned: str = ""
    published: float | None = None
    straight: float | None = None
    peers: str = ""
    value: bool = False


CASES = (
    *(
        Case(
            f"Figure 31, speed in the breast, water {water}",
            "chapter6",
            f"Figure 31 default, coupling {water}",
            f"Figure 31 tuned, coupling {water}",
            3.0,
            25.0,
        )
        for water in (1375, 1500)
    ),
    *(
        Case(
            f"Figure 31, attenuation, water {water}",
            "chapter6",
            f"Figure 31 attenuation, coupling {water}",
            published=0.07,
        )
        for water in (1375, 1500)
    ),
    *(
        Case(
            f"unseen slice, water {water} (not published)",
            "reconstruction_peers",
            f"R6 unseen slice rmse, default, water {water}",
            peers="R6 rmse below ",
        )
        for water in (1475, 1500)
    ),
    *(
        Case(
            f"Figure 32, speed, {section}, water {water}",
            "chapter7",
            f"Figure 32 default, whole image, {section}, coupling {water}",
            f"Figure 32 tuned, whole image, {section}, coupling {water}",
            0.04,
            0.25,
        )
        for water in (1375, 1500)
        for section in ("centre", "bottom")
    ),
    *(
        Case(
            f"Figure 33, attenuation, centre, water {water}",
            "chapter7",
            f"Figure 33 attenuation, centre, coupling {water}",
            published=0.075,
        )
        for water in (1375, 1500)
    ),
    *(
        Case(
            f"Figure 34, {way}, {skin}",
            "reconstruction_volume",
            f"R9 {skin}, {way}, whole image",
            published=published,
        )
        for skin in ("skin", "no skin")
        for way, published in (("slices", 0.036), ("in space", 0.034))
    ),
    Case(
        "Figure 34, slices scanned by waves (tuned: waveform)",
        "chapter7_waves",
        "M1 slices, default settings, whole image",
        "M1 slices, waveform, whole image",
        0.036,
    ),
    Case(
        "Table 8, 128² by 40, three iterations (Tesla)",
        "reconstruction_time",
        "R5 128² by 40, 256 transducers",
        published=30.9,
        value=True,
    ),
    Case(
        "Table 8, 256² by 44, three iterations (Tesla)",
        "reconstruction_time",
        "R5 256² by 44, 512 transducers",
        published=225.76,
        value=True,
    ),
)


def verdict(value: float | None, goal: float, met: bool) -> str:
    """Verdict on a value beside a published one: reproduced where it rounds to it; empty without a value."""
    if value is None:
        return ""
    published = Decimal(str(goal))
    last_digit = Decimal(1).scaleb(min(int(published.as_tuple().exponent), 0))
    if abs(Decimal(value) - published) <= last_digit / 2:
        return REPRODUCED
    return BETTER if met else NOT_REACHED


def lines(rows: AllRows, cases: tuple[Case, ...] = CASES) -> Iterator[dict[str, Any]]:
    """The lines whose rows were measured; a figure is None where there is none."""
    for case in cases:
        own = rows.get(case.benchmark, {})
        row = own.get(case.default)
        if row is None:
            continue
        default = row["value"] if case.value else row.get("error", row["value"])
        baselines = {} if case.value else row.get("baselines", {})
        tuned = own.get(case.tuned, {})
        yield {
            "case": case.name,
            "unit": row["unit"],
            "published": case.published,
            "published_straight": case.straight,
            "best_peer": best_peer(case, own, default),
            "best_constant": baselines.get("best constant"),
            "straight": baselines.get("straight rays"),
            "default": default,
            "tuned": tuned.get("error", tuned.get("value")),
            # Errors and times: less is better.
            "verdict": ""
            if case.published is None
            else verdict(default, case.published, default <= case.published),
        }


def best_peer(
    case: Case, rows: Mapping[str, Mapping[str, Any]], default: float | None
) -> dict[str, Any] | None:
    """Name and error of the peer with the smallest error; its rows hold errors over ours."""
    if not case.peers or default is None:
        return None
    water = case.default.rsplit(", ", 1)[1]
    peers = {
        label.removeprefix(case.peers).removesuffix(f", {water}"): row["value"] * default
        for label, row in rows.items()
        if label.startswith(case.peers) and label.endswith(water) and row["value"] is not None
    }
    if not peers:
        return None
    name = min(peers, key=peers.__getitem__)
    return {"name": name, "error": peers[name]}
