"""Fixtures of this folder: the opened OpenCL device, and simulated devices."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from bentray_kernels.opencl import Device, Session, device_selection, engine_selection, self_test_results

GPU = Device(0, "Fast Platform", "GPU 9000", "gpu", "OpenCL 3.0", "1.2.3", True)


@pytest.fixture(scope="session")
def session(opencl_session: Session) -> Session:
    return opencl_session


@pytest.fixture
def gpu() -> Device:
    return GPU


@pytest.fixture
def three() -> tuple[Device, ...]:
    """A processor, a GPU and one more of the same, in the order of their platforms."""
    cpu = replace(GPU, platform="Slow Platform", name="Processor", kind="cpu")
    return (cpu, replace(GPU, index=1), replace(GPU, index=2, name="GPU 9001"))


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """Nothing remembered of any device, in the process or on disk; gives the folder of the latter."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("BENTRAY_OPENCL_DEVICE", raising=False)
    monkeypatch.delenv("BENTRAY_DEVICE", raising=False)
    remembered = (
        self_test_results.self_test_result,
        device_selection._found,
        device_selection._opened,
        device_selection._warn_once,
        engine_selection._devices,
        engine_selection._passing,
        engine_selection._tried,
    )
    for function in remembered:
        function.cache_clear()
    yield tmp_path / "bentray"
    for function in remembered:
        function.cache_clear()
