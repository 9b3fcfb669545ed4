"""The report of the dissertation, with benchmarks made for the test."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import pytest
from benchmarks.dissertation import dissertation
from benchmarks.dissertation._outline import CHAPTERS, benchmarks_of, items
from benchmarks.dissertation._page import fragment, page
from benchmarks.dissertation._parts import Parts
from benchmarks.dissertation._report import MISSED, PARTLY, REPRODUCED, SKETCH, report_of
from benchmarks.dissertation._summary import CASES
from typer.testing import CliRunner

from bentray_kernels.errors import InvalidInput
from bentray_service.cli import app
from bentray_service.cli import bench as command
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

ROOT = Path(__file__).resolve().parents[2]
NAMES = benchmarks_of(tuple(items()))
PNG = b"\x89PNG"
IMAGE = {"best constant": 0.3, "water alone": 0.4, "straight rays": 0.2, "default settings": 0.1}


class Fakes:
    """Benchmarks by name: each yields two rows for every label of the outline, and its pictures."""

    def __init__(self) -> None:
        self.ran: list[str] = []
        self.stops: dict[str, BaseException] = {}

    def load(self, name: str) -> Callable[[BenchmarkContext], Iterable[Row]]:
        def rows(context: BenchmarkContext) -> Iterable[Row]:
            self.ran.append(name)
            sources = [(item, one) for item in items() for one in item.sources if one.benchmark == name]
            for file in {file for item, _ in sources for file in item.pictures}:
                context.save_picture(file, lambda: PNG)
            context.progress(1, 2, "half")
            for target in dict.fromkeys(target for _, one in sources for target in one.targets):
                yield Row(f"{target} <first>", 0.1, 0.2, "<=", "of range", "a & b", baselines=IMAGE)
                yield Row(f"{target} second", 2.0, 1.0, "<=", "", "missed")
            if name in self.stops:
                raise self.stops[name]
            if name == "reconstruction_volume":
                context.cluster()

        return rows

    def report(self, folder: Path, *only: str, quick: bool = True, scheduler: str | None = None) -> dict:
        context = BenchmarkContext(quick, lambda done, total, note="": None, scheduler=scheduler)
        return dissertation.report(context, folder, only, self.load, lambda line: None)


@pytest.fixture
def fakes(monkeypatch: pytest.MonkeyPatch) -> Fakes:
    monkeypatch.setattr(BenchmarkContext, "cluster", lambda self: nullcontext())
    return Fakes()


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


def test_a_second_run_continues_after_the_parts_that_are_complete(fakes: Fakes, tmp_path: Path):
    fakes.stops[NAMES[3]] = KeyboardInterrupt()
    with pytest.raises(KeyboardInterrupt):
        fakes.report(tmp_path)
    assert fakes.ran == NAMES[:4]
    early = json.loads((tmp_path / "report.json").read_text())
    assert [part["benchmark"] for part in early["parts"] if part["measured"]] == NAMES[:3]
    assert not early["complete"]
    fakes.stops.clear()
    fakes.ran.clear()
    made = fakes.report(tmp_path)
    assert fakes.ran == NAMES[3:]
    assert made["complete"]
    fakes.ran.clear()
    assert fakes.report(tmp_path) == made
    assert fakes.ran == []


def test_a_killed_run_loses_only_the_part_in_progress(tmp_path: Path):
    code = f"""
import os, signal, sys
from pathlib import Path
sys.path[:0] = [{str(ROOT)!r}, {str(ROOT / "tests" / "benchmarks")!r}]
from test_dissertation import NAMES, BenchmarkContext, Fakes
BenchmarkContext.cluster = lambda self: None
class Killed(Fakes):
    def load(self, name):
        rows = super().load(name)
        def killed(context):
            for row in rows(context):
                yield row
                if name == NAMES[2]:
                    os.kill(os.getpid(), signal.SIGKILL)
        return killed
Killed().report(Path({str(tmp_path)!r}))
"""
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True)
    assert done.returncode == -signal.SIGKILL, done.stderr.decode()
    parts = Parts(tmp_path)
    assert [name for name in NAMES if parts.read(name)] == NAMES[:2]
    assert json.loads((tmp_path / "report.json").read_text())["chapters"]


def test_a_part_of_other_settings_is_measured_again(
    fakes: Fakes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    fakes.report(tmp_path, "table8")
    of_table8 = list(fakes.ran)
    for settings in ({"quick": False}, {"scheduler": "tcp://head:8786"}):
        fakes.ran.clear()
        fakes.report(tmp_path, "table8", **settings)
        assert fakes.ran == of_table8
    monkeypatch.setattr("benchmarks.dissertation._parts.version", lambda name: "99")
    fakes.ran.clear()
    fakes.report(tmp_path, "table8")
    assert fakes.ran == of_table8
    monkeypatch.setattr("benchmarks.dissertation._parts.digest", lambda name: "other sources")
    fakes.ran.clear()
    fakes.report(tmp_path, "table8")
    assert fakes.ran == of_table8


def test_a_part_is_measured_again_if_its_file_or_a_picture_is_damaged(fakes: Fakes, tmp_path: Path):
    fakes.report(tmp_path, "figure9", "figure1")
    assert fakes.ran == ["chapter3", "splines"]
    (tmp_path / "parts" / "chapter3" / "figure9.png").unlink()
    (tmp_path / "parts" / "splines.json").write_text('{"benchmark":')
    fakes.ran.clear()
    fakes.report(tmp_path, "figure9", "figure1")
    assert fakes.ran == ["chapter3", "splines"]


def test_only_measures_the_items_that_are_named_and_keeps_earlier_parts(fakes: Fakes, tmp_path: Path):
    fakes.report(tmp_path, "Table 5")
    made = fakes.report(tmp_path, "chapter7", "figure-31")
    assert fakes.ran == ["table5", *benchmarks_of((*CHAPTERS[4].items, by_name("Figure 31")))]
    assert {state_of(made, "Table 5"), state_of(made, "Figure 32")} == {PARTLY}
    assert state_of(made, "Figure 9") == "not measured"
    assert not made["complete"]


def test_an_unknown_item_is_refused_before_anything_runs(fakes: Fakes, tmp_path: Path):
    with pytest.raises(InvalidInput, match=r"'figure99'; accepted: one of chapter3, .*figure34, table8$"):
        fakes.report(tmp_path, "figure99")
    assert fakes.ran == []


def test_a_benchmark_that_stops_is_stated_and_tried_again(fakes: Fakes, tmp_path: Path):
    fakes.stops["table5"] = ImportError("no such peer")
    made = fakes.report(tmp_path, "table5")
    item = of(made, "Table 5")
    assert item["errors"] == ["table5 stopped: ImportError: no such peer"]
    assert item["rows"], "rows before the error are kept"
    fakes.stops.clear()
    fakes.ran.clear()
    assert of(fakes.report(tmp_path, "table5"), "Table 5")["errors"] == []
    assert fakes.ran == ["table5"]


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


def test_the_page_is_self_contained_and_escaped(fakes: Fakes, tmp_path: Path):
    made = fakes.report(tmp_path)
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


def test_which_parts_used_workers_is_stated(fakes: Fakes, tmp_path: Path):
    made = fakes.report(tmp_path, "figure34", "table5", scheduler="tcp://head:8786")
    on_workers = {part["benchmark"]: part["on_workers"] for part in made["parts"] if part["measured"]}
    assert on_workers == {"reconstruction_volume": True, "table5": False}
    assert made["cluster"] == "workers of tcp://head:8786"


def test_an_address_without_a_scheduler_is_refused_before_anything_runs(tmp_path: Path):
    fakes = Fakes()
    with pytest.raises(InvalidInput, match="scheduler_address"):
        fakes.report(tmp_path, "table5", scheduler="tcp://127.0.0.1:1")
    assert fakes.ran == []


def test_the_command(fakes: Fakes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(command, "load", lambda name, folder: fakes.load(name))
    folder = tmp_path / "report"

    def run(*words: object) -> tuple[int, str, str]:
        done = CliRunner().invoke(app, ["bench", *map(str, words)])
        return done.exit_code, done.stdout, done.stderr

    status, stdout, stderr = run("dissertation", "--only", "table5", "--quick", "-o", folder)
    assert status == 0, stderr
    assert stdout.splitlines()[-2:] == [str(folder / "report.html"), str(folder / "report.json")]
    assert "table5: 2 rows" in stderr
    fakes.stops["table8"] = RuntimeError("no memory")
    status, _, stderr = run("dissertation", "--only", "table8", "--quick", "-o", folder)
    assert status == 1
    assert "table8: RuntimeError: no memory" in stderr
    for words, reason in (
        (("dissertation",), "-o: found none; accepted: a folder for the report of dissertation"),
        (("dissertation", "-o", folder / "report.json"), "-o: found"),
        (
            ("dissertation", "-o", folder, "--json", tmp_path / "a.json"),
            "--json: found given with dissertation",
        ),
        (
            ("dissertation", "-o", folder, "--only", "table9"),
            "--only: found 'table9'; accepted: one of chapter3",
        ),
        (("table5", "-o", folder), "-o: found given with table5; accepted: the benchmark dissertation"),
        (("table5", "--only", "table5"), "--only: found given with table5"),
        (("table5",), "--json: found none; accepted: a path in an existing folder"),
    ):
        status, _, stderr = run(*words)
        assert status == 2, words
        assert reason in stderr, words


def by_name(name: str):
    return next(item for item in items() if item.name == name)


def of(made: dict, name: str) -> dict:
    return next(item for one in made["chapters"] for item in one["items"] if item["name"] == name)


def state_of(made: dict, name: str) -> str:
    return of(made, name)["state"]
