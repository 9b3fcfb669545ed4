"""A report of the dissertation is resumed, narrowed and refused; with benchmarks made for the test."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path

import pytest
from benchmarks.dissertation import dissertation
from benchmarks.dissertation._outline import CHAPTERS, benchmarks_of
from benchmarks.dissertation._report import PARTLY
from typer.testing import CliRunner

from bentray_kernels.errors import InvalidInput
from bentray_service.cli import app
from bentray_service.cli import bench as command
from bentray_service.cli.output.benchmark_context import BenchmarkContext

from ._fake_benchmarks import NAMES, Fakes, by_name, in_this_process, of, state_of


@pytest.fixture
def fakes(monkeypatch: pytest.MonkeyPatch) -> Fakes:
    monkeypatch.setattr(BenchmarkContext, "cluster", lambda self: nullcontext())
    return Fakes()


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


def test_an_address_without_a_scheduler_is_refused_before_anything_runs(
    fakes: Fakes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def refuse(self: BenchmarkContext) -> None:
        raise InvalidInput("scheduler_address", self.scheduler, "the address of a running Dask scheduler")

    monkeypatch.setattr(BenchmarkContext, "cluster", refuse)
    with pytest.raises(InvalidInput, match="scheduler_address"):
        fakes.report(tmp_path, "table5", scheduler="tcp://head:1")
    assert fakes.ran == []


def test_the_command(fakes: Fakes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(command, "load", lambda name, folder: fakes.load(name))
    monkeypatch.setattr(dissertation.report, "__defaults__", (in_this_process,))
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
