"""Rows of R6: their ratios, and rows without a value where a peer is missing."""

from __future__ import annotations

import pytest
from benchmarks.reconstruction import reconstruction_peers
from benchmarks.reconstruction.reconstruction_peers import Found, peer_rows, rows
from benchmarks.shared._baselines import Compared

from bentray_service.cli.output.benchmark_context import BenchmarkContext

BESIDE = Compared(20.0, {"best constant": 50.0})


def quiet(done: int, total: int, note: str = "") -> None:
    """No progress bar."""


def test_a_peer_that_is_worse_and_slower_gives_ratios_above_one() -> None:
    ours, theirs = Found(20.0, 9.0, 4.0), Found(30.0, 1.0, 12.0)
    error, time = peer_rows("peer, water 1500", theirs, ours, BESIDE, "sart", "")
    assert (error.target, error.value, error.met) == ("R6 rmse below peer, water 1500", 1.5, True)
    assert (time.target, time.value, time.met) == ("R6 time below peer, water 1500", 3.0, True)
    error, time = peer_rows("peer", ours, theirs, BESIDE, "sart", "")
    assert not error.met
    assert not time.met


def test_a_missing_peer_gives_rows_without_a_value() -> None:
    missing = list(peer_rows("peer", None, Found(20.0, 9.0, 4.0), BESIDE, "sart", "peer is not installed"))
    assert [(row.value, row.met, row.detail) for row in missing] == [
        (None, False, "peer is not installed")
    ] * 2


def test_rows_report_a_missing_time_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        reconstruction_peers._eikonal_peers,
        "installed",
        lambda: ({}, {reconstruction_peers.SOLVER: "eikonalfm is not installed"}),
    )
    found = list(rows(BenchmarkContext(True, quiet)))
    assert [row.value for row in found] == [None]
    assert found[0].detail == "eikonalfm is not installed"
