"""Tables and figures of the dissertation, their states, and the page that shows them."""

from __future__ import annotations

import json
import re
from contextlib import nullcontext
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest
from benchmarks.dissertation._outline import CHAPTERS, items
from benchmarks.dissertation._page import fragment, page
from benchmarks.dissertation._recorded import RECORDED, recorded_parts
from benchmarks.dissertation._report import MISSED, PARTLY, REPRODUCED, SKETCH, report_of
from benchmarks.dissertation._summary import CASES

from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ._fake_benchmarks import IMAGE, Fakes, of, state_of

ROOT = Path(__file__).resolve().parents[2]


def test_every_table_and_figure_of_chapters_3_to_7_is_listed():
    assert [chapter.number for chapter in CHAPTERS] == [3, 4, 5, 6, 7]
    listed = [item.name for item in items()]
    assert sorted(listed, key=lambda name: (name[0], int(name.split()[1]))) == [
        *(f"Figure {number}" for number in range(1, 35)),
        *(f"Table {number}" for number in range(1, 9)),
    ]
    last = {3: 9, 4: 22, 5: 27, 6: 31, 7: 34}
    for chapter in CHAPTERS:
        figures = [int(item.name.split()[1]) for item in chapter.items if item.name.startswith("Figure")]
        assert figures == list(range(last.get(chapter.number - 1, 0) + 1, last[chapter.number] + 1))
    for item in items():
        assert item.sketch or item.sources, item.name
        assert item.why or not item.unreached, item.name


def test_labels_of_the_outline_and_of_the_summary_are_labels_of_recorded_rows():
    for item in items():
        for source in item.sources:
            file = ROOT / f"benchmarks/results/{source.benchmark}.json"
            assert list((ROOT / "benchmarks").glob(f"*/{source.benchmark}.py")), source.benchmark
            for target in source.targets if file.exists() else ():
                labels = [row["target"] for row in json.loads(file.read_text())]
                assert any(label.startswith(target) for label in labels), (source.benchmark, target)
    for case in CASES:
        file = ROOT / f"benchmarks/results/{case.benchmark}.json"
        if file.exists():
            labels = [row["target"] for row in json.loads(file.read_text())]
            for name in filter(None, (case.default, case.tuned)):
                # Some recorded files hold one water only.
                stem = re.split(", (?:coupling|water) ", name)[0]
                assert any(label.startswith(stem) for label in labels), case.name


def test_states_counts_and_sentences():
    def part(*rows: Row) -> SimpleNamespace:
        listed = [row.to_dict() for row in rows]
        return SimpleNamespace(
            benchmark="table5",
            rows=listed,
            pictures=[],
            error="",
            measured="2026-01-01",
            seconds=1.0,
            load=0.5,
            uses_cluster=False,
        )

    met, missed = (Row(f"Table 5 {value}", value, 2.0, "<=", "s", "") for value in (1.0, 3.0))
    absent = Row("Table 5 none", None, 2.0, "<=", "s", "no peer")
    for rows, state in (((met, absent), REPRODUCED), ((met, missed), PARTLY), ((missed,), MISSED)):
        made = report_of({"table5": part(*rows)}, quick=False, cluster="own workers")
        assert state_of(made, "Table 5") == state
        assert bool(of(made, "Table 5")["sentence"]) is (state != REPRODUCED)
    assert made["rows"] == {"met": 0, "missed": 1, "without a value": 0}
    for one in made["chapters"]:
        for item in one["items"]:
            assert item["sentence"].count(". ") == 0, item["sentence"]
    assert of(made, "Figure 24")["state"] == SKETCH
    # A published value that no row has as its goal.
    frames = part(Row("Figure 26, 27: ball refracting", 0.5, 1.0, "<=", "%", ""))
    frames.benchmark = "chapter5"
    made_of_frames = report_of({"chapter5": frames}, quick=True, cluster="own workers")
    assert state_of(made_of_frames, "Figure 27") == PARTLY
    assert of(made_of_frames, "Figure 27")["sentence"].startswith("The published rates")
    quick = report_of({"table5": part(missed)}, quick=True, cluster="own workers")
    assert of(quick, "Table 5")["sentence"].startswith("1 of 1 rows miss their goal on the small problems")


def test_the_summary_names_the_best_peer_and_the_baselines():
    peers = {"pyGIMLi": 1.2, "ttcrpy": 1.1}
    water = "water 1500"
    rows = [Row(f"R6 unseen slice rmse, default, {water}", 25.0, 28.0, "<=", "m/s", "", baselines=IMAGE)]
    rows += [Row(f"R6 rmse below {name}, {water}", ratio, 1.0, ">", "", "") for name, ratio in peers.items()]
    part = SimpleNamespace(
        benchmark="reconstruction_peers",
        rows=[row.to_dict() for row in rows],
        pictures=[],
        error="",
        measured="2026-01-01",
        seconds=1.0,
        load=0.5,
        uses_cluster=False,
    )
    (line,) = report_of({"reconstruction_peers": part}, quick=False, cluster="")["summary"]
    assert line["best_peer"] == {"name": "ttcrpy", "error": pytest.approx(27.5)}
    assert (line["default"], line["best_constant"], line["straight"]) == (25.0, 0.3, 0.2)
    assert line["published"] is None


class Outside(HTMLParser):
    """Collects every address that a page would load or link to."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("src", "href", "srcset", "action", "poster", "data") and value is not None:
                self.found.append(value)


def test_the_page_is_self_contained_and_escaped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(BenchmarkContext, "cluster", lambda self: nullcontext())
    made = Fakes().report(tmp_path)
    html = (tmp_path / "report.html").read_text()
    parser = Outside()
    parser.feed(html)
    assert parser.found
    assert all(address.startswith(("data:image/png;base64,", "#")) for address in parser.found)
    assert not re.search(r"https?://|url\(|@import|<script|<link", html)
    assert "&lt;first&gt;" in html
    assert "a &amp; b" in html
    assert html.count("<img") == len({file for item in items() for file in item.pictures})
    targets = re.findall(r' id="([^"]+)"', html)
    assert len(targets) == len(set(targets))
    assert {address[1:] for address in parser.found if address.startswith("#")} <= set(targets)
    assert "prefers-color-scheme: dark" in html
    assert "@media print" in html
    assert "width=device-width" in html
    for item in items():
        assert f">{item.name}<" in html
    inner = fragment(made, lambda benchmark, name: None)
    assert "<html" not in inner
    assert "<img" not in inner
    assert "Quick run." in inner
    assert "Quick run." not in page(made | {"quick": False}, lambda benchmark, name: None)


def test_the_page_of_the_documentation_shows_every_item_by_its_recorded_rows(
    monkeypatch: pytest.MonkeyPatch,
):
    results = ROOT / "benchmarks/results"
    made = report_of(recorded_parts(results), quick=False, cluster=RECORDED, recorded=True)
    assert made["complete"], [part["benchmark"] for part in made["parts"] if not part["measured"]]
    rows = {row["target"]: row for row in json.loads((results / "table5.json").read_text())}
    assert of(made, "Table 5")["rows"] == [row for row in rows.values() if row in of(made, "Table 5")["rows"]]
    assert of(made, "Table 5")["rows"]
    assert "<!-- from the code: dissertation -->" in (ROOT / "docs/explanation/how-good-is-it.md").read_text()
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    text = import_module("from_code.dissertation").dissertation()
    assert "recorded rows" in text
    assert "Quick run." not in text
    assert "Incomplete." not in text
    assert text.count("<img") == len({file for item in items() for file in item.pictures})
    assert all(f"<h3>{item.name}</h3>" in text for item in items())
