"""Fixtures of the command line: a runner and a small scan."""

from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from bentray_kernels.acquisition import Dataset
from bentray_service.cli import app
from bentray_service.interactive import progress_bar
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.simulation_run import simulate

Run = Callable[..., Result]


@pytest.fixture
def bentray(monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run the command line in this process, to an exit code: ``bentray("simulate", "-o", path, code=2)``."""
    # A slow machine would print lines of progress.
    monkeypatch.setattr(progress_bar, "FIRST_LINE_S", 3600.0)

    def run(*words: object, code: int = 0) -> Result:
        result = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
        assert result.exit_code == code, result.output
        return result

    return run


@pytest.fixture(scope="session")
def scan() -> Dataset:
    """A phantom scan small enough for a test."""
    return simulate(SimulationSettings(nodes=32, elements=24, coupling_mps=1375.0))


@pytest.fixture(scope="session")
def scan_file(scan: Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scan as a file."""
    from bentray_workers.files.dataset import write_dataset

    path = tmp_path_factory.mktemp("scan") / "scan.h5"
    write_dataset(path, scan)
    return path
