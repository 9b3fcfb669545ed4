"""Parts of a report in processes of their own, with a benchmark made for the test."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from benchmarks.dissertation._parts import Parts
from benchmarks.dissertation._process import measure_in_process

from bentray_service.cli import bench as command
from bentray_service.cli.output.benchmark_context import BenchmarkContext

ROOT = Path(__file__).resolve().parents[2]


BENCHMARK = """
import os, signal, time
from pathlib import Path
from bentray_service.cli.output.benchmark_row import Row

def rows(context):
    context.progress(1, 2, "half")
    context.save_picture("drawn.png", lambda: b"picture")
    yield Row("one", 1.0, 2.0, "<=", "", "")
    place = Path(__file__).parent
    if (place / "kill").exists():
        os.kill(os.getpid(), signal.SIGKILL)
    if (place / "wait").exists():
        (place / "pid").write_text(str(os.getpid()))
        time.sleep(600.0)
"""


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Folder of one benchmark, as the command finds them."""
    folder = tmp_path / "own_benchmarks" / "table"
    folder.mkdir(parents=True)
    (folder / "own.py").write_text(BENCHMARK)
    return folder


@pytest.mark.nightly
def test_a_benchmark_in_its_own_process_may_end_it(table: Path, tmp_path: Path):
    shown: list[tuple[int, int, str]] = []
    context = BenchmarkContext(True, lambda done, total, note="": shown.append((done, total, note)))
    load, store = partial(command.load, folder=table.parent), Parts(tmp_path)
    part = measure_in_process(load, store, "own", context)
    assert (part.error, [row["target"] for row in part.rows], part.pictures) == ("", ["one"], ["drawn.png"])
    assert part == store.read("own")
    assert shown == [(1, 2, "half")]
    (table / "kill").touch()
    part = measure_in_process(load, store, "own", context)
    assert part.error == "its process ended with signal SIGKILL"
    assert part == store.read("own")
    assert store.complete("own", part.settings) is None


@pytest.mark.nightly
def test_the_process_of_a_part_ends_with_a_command_that_is_killed(table: Path, tmp_path: Path):
    (table / "wait").touch()
    code = f"""
import sys
from functools import partial
from pathlib import Path
sys.path.insert(0, {str(ROOT)!r})
from bentray_service.cli.bench import load
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from benchmarks.dissertation._parts import Parts
from benchmarks.dissertation._process import measure_in_process
if __name__ == "__main__":
    context = BenchmarkContext(True, print)
    find = partial(load, folder=Path({str(table.parent)!r}))
    measure_in_process(find, Parts(Path({str(tmp_path)!r})), "own", context)
"""
    script = tmp_path / "killed.py"
    script.write_text(code)
    with subprocess.Popen([sys.executable, script]) as process:
        pid = int(eventually(lambda: (table / "pid").exists() and (table / "pid").read_text()))
        process.kill()
    eventually(lambda: not Path(f"/proc/{pid}").exists() or "Z" in status_of(pid))
    assert Parts(tmp_path).read("own") is None


def eventually(found: Callable[[], object]) -> Any:
    until = time.monotonic() + 60.0
    while not (value := found()):
        assert time.monotonic() < until
        time.sleep(0.05)
    return value


def status_of(pid: int) -> str:
    with suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    return "Z"
