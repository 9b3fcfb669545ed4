"""Precompilation: jobs on other scans compile nothing more, and compilation is logged."""

import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest

from bentray_kernels.compilation.compile_events import Compilation
from bentray_workers.compilation import cache_misses
from bentray_workers.compilation.precompile import WAVES, digitised
from bentray_workers.simulation.simulation_run import simulate

# Jobs of a process that finds the cache of another: the kernels that it compiles all the same.
JOBS = """
import sys, warnings
from pathlib import Path
from bentray_kernels.tomography import Settings
from bentray_workers.compilation import cache_misses
from bentray_workers.files.dataset import write_dataset
from bentray_workers.compilation.precompile import digitised
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.reconstruction.reconstruction_run import reconstruct
from bentray_workers.simulation.waves import WaveSimulationSettings

warnings.simplefilter("ignore")
cache_misses.announce()
times, waves = Path(sys.argv[1], "times.h5"), Path(sys.argv[1], "waves.h5")
with cache_misses.compiled_kernels() as kernels:
    write_dataset(times, simulate(SimulationSettings(nodes=32, elements=32, coupling_mps=1425.0)))
    scan = simulate(WaveSimulationSettings(3e5, 0.04, 32, 16, 32, snr=30.0))
    write_dataset(waves, digitised(scan))
    for method in ("sart", "auto", "gauss-newton"):
        reconstruct(None, times, Settings(nodes=32, method=method))
    reconstruct(None, waves, Settings.from_values(nodes=32, method="waveform", bands=1, emitters=4))
print(*kernels, sep="\\n")
"""


def test_a_digitised_scan_holds_the_same_traces() -> None:
    scan = simulate(WAVES)
    assert scan.waveform is not None
    waveform = digitised(scan).waveform
    assert waveform is not None
    assert waveform.object.dtype == "int16"
    assert abs(waveform.scale * waveform.object - scan.waveform.object).max() <= 0.5001 * waveform.scale


def test_a_kernel_that_is_compiled_is_noted_and_announced_once(caplog: pytest.LogCaptureFixture) -> None:
    program = """
import logging, numba
from bentray_workers.compilation import cache_misses
logging.basicConfig(format="%(message)s")
cache_misses.announce()
cache_misses.announce()
with cache_misses.compiled_kernels() as kernels:
    numba.njit(lambda x: x + 1)(1)
    numba.njit(lambda x: x + 2)(1)
print(len(kernels))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "2\n"
    assert done.stderr.count("Compiling kernels for this processor") == 1


@pytest.mark.nightly
def test_jobs_find_every_kernel_compiled(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    ahead = [sys.executable, "-m", "bentray_workers.compilation.precompile"]
    done = subprocess.run(ahead, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.endswith("kernels compiled\n")
    later = [sys.executable, "-c", JOBS, str(tmp_path)]
    done = subprocess.run(later, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
    assert done.stderr == ""


def test_a_log_has_the_first_kernel_and_the_counts(monkeypatch, caplog):
    counts = Compilation(31, 120, active=True)
    monkeypatch.setattr(cache_misses, "compilation", lambda: counts)
    monkeypatch.setattr(cache_misses, "LINE_S", 0.0)
    caplog.set_level(logging.WARNING, "bentray.compiling")
    with_bar, of_worker = (cache_misses.Announcer(counts=counts) for counts in (False, True))
    for announcer in (with_bar, of_worker):
        announcer.on_start(None)
        announcer.on_end(None)
        announcer.on_start(None)
    first, alone, line = (record.getMessage() for record in caplog.records)
    assert first == alone
    assert first.startswith("Compiling kernels for this processor (")
    assert line == "Compiling kernels: 31 of 120"
