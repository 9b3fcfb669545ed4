"""The bench frame, with a benchmark made for the test."""

import json
import sys
from datetime import date, timedelta
from pathlib import Path

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.cli import bench as module
from bentray_service.cli.bench import REPORT, benchmark_folder, load, module_of
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.exit_codes import WorkFailed
from bentray_workers.cluster.connection import open_cluster

from .conftest import Run

FAKE = """
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

def rows(context):
    context.progress(1, 2, "first")
    context.save_picture("fake.png", lambda: b"picture")
    yield Row("E1", 2.5 if context.quick else 1.0, 2.0, ">=", "", "ratio of times")
    yield Row("E2", None, 1.02, "<=", "", "eikonalfm is not installed")
    yield Row("E3", float("nan"), 1.0, "<=", "s", "diverged")
"""

QUICK = BenchmarkContext(True, lambda done, total, note="": None)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of benchmarks that the command takes for its own."""
    benchmarks = tmp_path / "benchmarks"
    table = benchmarks / "table"
    table.mkdir(parents=True)
    (table / "fake.py").write_text(FAKE)
    (table / "empty.py").write_text("")
    (table / "_hidden.py").write_text(FAKE)
    monkeypatch.setattr("bentray_service.cli.bench.benchmark_folder", lambda: benchmarks)
    return benchmarks


@pytest.mark.parametrize(("options", "value", "met"), [([], 1.0, False), (["--quick"], 2.5, True)])
def test_the_rows_are_written_and_shown(
    bentray: Run, folder: Path, tmp_path: Path, options: list[str], value: float, met: bool
) -> None:
    file = tmp_path / "rows.json"
    result = bentray("bench", "fake", *options, "--json", file)
    rows = json.loads(file.read_text(), parse_constant=pytest.fail)
    assert [(row["target"], row["value"], row["met"]) for row in rows] == [
        ("E1", value, met),
        ("E2", None, False),
        ("E3", None, False),
    ]
    assert rows[1]["detail"] == "eikonalfm is not installed"
    assert date.fromisoformat(rows[1]["measured"]) <= date.today() + timedelta(days=1)
    assert "eikonalfm is not installed" in result.stdout
    assert result.stdout.splitlines()[-1] == str(file)


@pytest.mark.parametrize("name", ["nothing", "../fake", "_hidden", "fake.py"])
def test_an_unknown_name_lists_the_known_ones(bentray: Run, folder: Path, name: str) -> None:
    result = bentray("bench", name, "--json", folder / "rows.json", code=2)
    assert result.stderr == f"bentray: name: found {name!r}; accepted: one of empty, fake\n"


@pytest.mark.parametrize("name", ["two-words", "two_words", "distributed"])
def test_accepts_a_joined_command_line_and_the_name_of_a_package(folder: Path, name: str) -> None:
    (folder / "table" / f"{name.replace('-', '_')}.py").write_text(FAKE)
    rows = load(name, folder)(QUICK)
    assert [row.target for row in rows] == ["E1", "E2", "E3"]
    assert Path(str(sys.modules["distributed"].__file__)).name == "__init__.py"


def test_a_benchmark_without_rows_is_named(folder: Path) -> None:
    with pytest.raises(WorkFailed, match=r"benchmarks/table/empty.py defines no rows"):
        load("empty", folder)


def test_the_file_for_the_rows_is_checked_before_anything_runs(
    bentray: Run, folder: Path, tmp_path: Path
) -> None:
    (folder / "table" / "fake.py").write_text("raise SystemError('ran')")
    result = bentray("bench", "fake", "--json", tmp_path / "absent" / "rows.json", code=2)
    assert "its folder does not exist" in result.stderr


def test_pictures_are_written_only_to_the_folder_that_is_given(
    bentray: Run, folder: Path, tmp_path: Path
) -> None:
    before = sorted(tmp_path.rglob("*.png"))
    bentray("bench", "fake", "--json", tmp_path / "rows.json")
    assert sorted(tmp_path.rglob("*.png")) == before == []
    drawn = tmp_path / "drawn"
    result = bentray("bench", "fake", "--json", tmp_path / "rows.json", "--pictures", drawn, code=2)
    assert f"--pictures: found {drawn} (no such folder); accepted: an existing folder" in result.stderr
    drawn.mkdir()
    result = bentray("bench", "fake", "--json", tmp_path / "rows.json", "--pictures", drawn)
    assert (drawn / "fake.png").read_bytes() == b"picture"


ON_WORKERS = """
from bentray_service.cli.output.benchmark_row import Row

def rows(context):
    with context.cluster() as cluster, context.temporary_folder() as folder:
        (folder / "scan").write_text("abc")
        read = cluster.client.submit(lambda path: len(path.read_text()), folder / "scan", pure=False)
        yield Row("length", read.result(), 3.0, "==", "", cluster.describe()["scheduler"])
"""


def test_a_scheduler_is_used_where_a_benchmark_computes_on_workers(
    bentray: Run, folder: Path, tmp_path: Path
) -> None:
    (folder / "table" / "on_workers.py").write_text(ON_WORKERS)
    with open_cluster(workers=1, local_directory=tmp_path, processes=False) as cluster:
        address = cluster.describe()["scheduler"]
        bentray("bench", "on-workers", "--json", tmp_path / "rows.json", "--scheduler", address)
    (row,) = json.loads((tmp_path / "rows.json").read_text())
    assert (row["met"], row["detail"]) == (True, address)


def test_outside_a_checkout_the_reason_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed = tmp_path / "lib" / "site-packages" / "bentray_service" / "cli" / "bench.py"
    monkeypatch.setattr(module, "__file__", str(installed))
    with pytest.raises(InvalidInput, match="a source checkout"):
        benchmark_folder()


@pytest.mark.parametrize("path", sorted(benchmark_folder().glob("*/[!_]*.py")), ids=lambda path: path.stem)
def test_every_benchmark_of_the_checkout_fits_the_frame(path: Path) -> None:
    if path.stem == REPORT:
        assert callable(module_of(path.stem, path.parents[1]).report)
    else:
        assert callable(load(path.stem, path.parents[1]))


@pytest.mark.slow
@pytest.mark.nightly
def test_reconstruction_benchmark_reports_all_rows() -> None:
    rows = list(load("reconstruction", benchmark_folder())(QUICK))
    assert all(isinstance(row, Row) for row in rows)
    labels = {row.target.split()[0] for row in rows}
    assert {"R1", "R3"} <= labels
    by_target = {row.target: row for row in rows}
    assert by_target["R3 straight > fixed, coupling 1375"].met
