"""Tables and figures of the dissertation, their states, and the page that shows them."""

import json
import re
from importlib import import_module
from pathlib import Path

import pytest
from benchmarks.dissertation._outline import CHAPTERS, items
from benchmarks.dissertation._parts import RECORDED, recorded_parts
from benchmarks.dissertation._report import report_of
from benchmarks.dissertation._summary import BETTER, CASES, NOT_REACHED, REPRODUCED, VERDICTS, verdict

ROOT = Path(__file__).resolve().parents[2]


def test_every_table_and_figure_of_chapters_3_to_7_is_listed():
    assert [chapter.number for chapter in CHAPTERS] == [3, 4, 5, 6, 7]
    listed = [item.name for item in items() if item.name != "Future work"]
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


@pytest.mark.parametrize(
    ("value", "goal", "met", "expected"),
    [
        (8.7, 25.0, True, BETTER),
        (0.0364, 0.036, False, REPRODUCED),
        (0.0356, 0.036, True, REPRODUCED),
        (0.0354, 0.036, True, BETTER),
        (0.0366, 0.036, False, NOT_REACHED),
        (0.48, 0.0, True, BETTER),
        (0, 0, True, REPRODUCED),
        (119.4, 119, True, REPRODUCED),
        (21.4, 44.0, False, NOT_REACHED),
        (None, 44.0, False, ""),
    ],
)
def test_reproduced_is_what_rounds_to_the_published_value(value, goal, met, expected):
    assert verdict(value, goal, met) == expected


def test_an_item_has_the_worst_verdict_of_its_rows():
    made = report_of(
        recorded_parts(ROOT / "benchmarks/results"), quick=False, cluster=RECORDED, recorded=True
    )
    unreached = {item.name for item in items() if item.unreached}
    described = [item for chapter in made["chapters"] for item in chapter["items"] if item["rows"]]
    for item in described:
        verdicts = {row["verdict"] for row in item["rows"]} - {""}
        worst = NOT_REACHED if item["name"] in unreached else min(verdicts, key=VERDICTS.index)
        assert item["state"] == worst, item["name"]
    assert {item["state"] for item in described} == set(VERDICTS)


def test_the_page_of_the_documentation_shows_every_item_by_its_recorded_rows(
    monkeypatch: pytest.MonkeyPatch,
):
    results = ROOT / "benchmarks/results"
    made = report_of(recorded_parts(results), quick=False, cluster=RECORDED, recorded=True)
    assert made["complete"], [part["benchmark"] for part in made["parts"] if not part["measured"]]
    rows = {row["target"]: row for row in json.loads((results / "table5.json").read_text())}
    (shown,) = [
        item["rows"] for one in made["chapters"] for item in one["items"] if item["name"] == "Table 5"
    ]
    plain = [{key: value for key, value in row.items() if key != "verdict"} for row in shown]
    assert plain == [row for row in rows.values() if row in plain]
    assert plain
    assert "<!-- from the code: dissertation -->" in (ROOT / "docs/explanation/how-good-is-it.md").read_text()
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    text = import_module("from_code.dissertation").dissertation()
    assert "recorded rows" in text
    assert "Quick run." not in text
    assert "Incomplete." not in text
    assert text.count("<img") == len({file for item in items() for file in item.pictures})
    assert all(f"<h3>{item.name}</h3>" in text for item in items())
