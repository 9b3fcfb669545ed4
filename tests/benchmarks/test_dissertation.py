"""A report of the dissertation is resumed, narrowed and refused; with benchmarks made for the test."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path

import pytest

from bentray_service.cli.output.benchmark_context import BenchmarkContext

from ._fake_benchmarks import NAMES, Fakes


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


def test_a_part_is_measured_again_if_its_file_or_a_picture_is_damaged(fakes: Fakes, tmp_path: Path):
    fakes.report(tmp_path, "figure9", "figure1")
    assert fakes.ran == ["chapter3", "splines"]
    (tmp_path / "parts" / "chapter3" / "figure9.png").unlink()
    (tmp_path / "parts" / "splines.json").write_text('{"benchmark":')
    fakes.ran.clear()
    fakes.report(tmp_path, "figure9", "figure1")
    assert fakes.ran == ["chapter3", "splines"]
