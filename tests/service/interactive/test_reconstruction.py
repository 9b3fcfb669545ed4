"""Reconstruction and simulation in a Python session: one pipeline, checked settings, Ctrl-C."""

from __future__ import annotations

import signal
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bentray
from bentray_kernels.task_graph import Cancelled
from bentray_kernels.tomography.result import Progress
from bentray_kernels.tomography.settings import Settings
from bentray_service.interactive import reconstruction
from bentray_service.interactive.reconstruction import OnProgress, Stop, run_interruptibly
from bentray_workers.compilation import cache_misses
from bentray_workers.reconstruction import reconstruction_run


def test_it_is_the_pipeline_of_the_service(simulated: bentray.Scan, tmp_path: Path) -> None:
    path = simulated.save(tmp_path / "scan.h5")
    settings = Settings.from_values(method="gauss-newton", nodes=24, iterations=2, penalty_strength=0.5)
    there = reconstruction_run.reconstruct(None, path, settings)
    result = bentray.reconstruct(
        path, "gauss-newton", nodes=np.int64(24), iterations=2, penalty_strength=0.5, threads=2
    )
    np.testing.assert_array_equal(result.speed, there.speed)
    assert result.settings == there.settings
    assert result.attributes["scan"] == "scan.h5"


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"itertions": 3}, "itertions: found 3; accepted: iterations is spelt like it; a known setting: "),
        ({"temperature_c": 30.0}, "accepted: water_temperature_c is spelt like it; "),
        ({"sweeps": 3}, "sweeps: found 3; accepted: iterations, which replaces it"),
        ({"zzz": 1}, "zzz: found 1; accepted: a known setting: method, rays, "),
        ({"method": "waveform"}, "accepted: "),
        ({"threads": 0}, "threads: found 0; accepted: a number from 1 to "),
    ],
)
def test_wrong_settings_are_named(simulated: bentray.Scan, settings: dict[str, Any], said: str) -> None:
    with pytest.raises(bentray.InvalidInput) as refused:
        bentray.reconstruct(simulated, **settings)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (
            {"elemnts": 16},
            "elemnts: found 16; accepted: elements is spelt like it; a known setting: phantom, ",
        ),
        ({"phantom": "table8"}, "phantom: found 'table8'; accepted: 'table6', "),
        ({"side_m": 0.1}, "side_m: found 0.1; accepted: null, unless waveform is true"),
    ],
)
def test_wrong_settings_of_a_simulation_are_named(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(bentray.InvalidInput) as refused:
        bentray.simulate(**settings)
    assert said in str(refused.value)


def test_a_simulation_has_the_truth_and_its_settings(simulated: bentray.Scan) -> None:
    assert simulated.truth is not None
    assert simulated.truth.sound_speed_mps.shape == (32, 32)
    assert len(simulated.position_m) == 24


def test_ctrl_c_stops_the_tasks_first(simulated: bentray.Scan, monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[BaseException] = []
    shown = threading.Event()
    run = reconstruction_run.reconstruct

    def watched(
        client: None, path: Path, settings: Settings, report: OnProgress, stop: Stop, threads: int | None
    ) -> Any:
        def wait_until_shown(progress: Progress) -> None:
            report(progress)
            # The computation goes on only after Ctrl-C, whose cause is that its progress was shown.
            while not stop():
                shown.wait(0.01)

        try:
            return run(client, path, settings, wait_until_shown, stop, threads=threads)
        except BaseException as error:
            ended.append(error)
            raise

    class Bar:
        def __init__(self, description: str, *, shown: bool) -> None: ...
        def __enter__(self) -> Bar:
            return self

        def __exit__(self, *_: object) -> None: ...
        def __call__(self, done: int, total: int, note: str = "") -> None:
            shown.set()
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(reconstruction_run, "reconstruct", watched)
    monkeypatch.setattr(reconstruction, "progress_bar", Bar)
    # A shell starts what runs in the background with the signal ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            bentray.reconstruct(simulated, "sart", nodes=24)
    finally:
        signal.signal(signal.SIGINT, before)
    assert [type(error) for error in ended] == [Cancelled]
    assert "bentray" not in {thread.name for thread in threading.enumerate()}


def test_work_that_fails_raises_its_error() -> None:
    def fail(report: OnProgress, stop: Stop) -> None:
        raise MemoryError("too large")

    with pytest.raises(MemoryError, match="too large"):
        run_interruptibly(fail, lambda _: None)


def test_progress_is_shown_by_the_calling_thread() -> None:
    seen: list[tuple[int, str]] = []
    latest = threading.Event()

    def work(report: OnProgress, stop: Stop) -> str:
        report(Progress(3, 4))
        latest.wait()
        return "made"

    def show(progress: Progress) -> None:
        seen.append((progress.done, threading.current_thread().name))
        latest.set()

    assert run_interruptibly(work, show) == "made"
    assert seen[-1][0] == 3
    assert {name for _, name in seen} == {threading.current_thread().name}


def test_compilation_is_announced(simulated: bentray.Scan, monkeypatch: pytest.MonkeyPatch) -> None:
    announced: list[str] = []
    monkeypatch.setattr(cache_misses, "announce", lambda: announced.append("kernels"))
    bentray.reconstruct(simulated, "sart", nodes=16, iterations=1)
    bentray.simulate(nodes=16, elements=8)
    assert announced == ["kernels"] * 2
