"""Where an engine computes: requests, the machine's variable, the benchmark, and the memory of the device."""

import re
import time
from dataclasses import replace

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import (
    DeviceLostError,
    DeviceSelection,
    SelfTestResult,
    Session,
    Work,
    device_benchmark,
    engine_selection,
    requested,
)
from bentray_kernels.opencl.device_benchmark import DeviceBenchmark, Timing
from bentray_kernels.opencl.engine_selection import misfit, select_engine
from bentray_kernels.opencl.lost_device import on_cpu

# Faster on the device from 100 units on.
TRIAL = DeviceBenchmark((Timing(10.0, 0.1, 1.0), Timing(1000.0, 10.0, 1.0)))
SMALL, LARGE = Work("field", 50.0), Work("field", 200.0)


class Opened:
    """In place of a session."""

    lost = ""

    def __init__(self, device):
        self.device = device


@pytest.fixture
def machine(monkeypatch, gpu, fresh):
    """A GPU that passes its tests; the fixture gives what was asked of it."""
    asked = []
    sessions = {}

    def tried(device, engine, time_out_s):
        asked.append("trial")
        return TRIAL if engine == "field" else DeviceBenchmark((), "it computes wrong results", 1)

    monkeypatch.setattr(engine_selection, "find_devices", lambda: asked.append("devices") or (gpu,))
    monkeypatch.setattr(
        engine_selection, "select_device", lambda: asked.append("verdict") or DeviceSelection(gpu, ())
    )
    monkeypatch.setattr(
        engine_selection,
        "self_test_result",
        lambda *_: asked.append("verdict") or SelfTestResult("", (1,), {}),
    )
    monkeypatch.setattr(engine_selection, "benchmark_engine", tried)
    monkeypatch.setattr(
        engine_selection, "open_session", lambda device: sessions.setdefault(device, Opened(device))
    )
    return asked


def test_auto_takes_what_is_faster_for_the_size(machine, gpu):
    assert select_engine(SMALL) is None
    assert select_engine(LARGE).device == gpu
    assert select_engine(Work("eikonal", 1e9)) is None, "an engine that is wrong there"


def test_cpu_asks_for_no_device(machine, monkeypatch):
    assert select_engine(LARGE, "cpu") is None
    monkeypatch.setenv("BENTRAY_DEVICE", "cpu")
    assert select_engine(LARGE) is None
    assert machine == []


def test_opencl_takes_the_device_whatever_the_trial(machine, gpu):
    assert select_engine(SMALL, "opencl").device == gpu
    assert "trial" not in machine


def test_opencl_without_a_device_is_an_error_before_any_work(machine, monkeypatch):
    monkeypatch.setattr(
        engine_selection,
        "select_device",
        lambda: DeviceSelection(None, ("GPU 9000 was refused: wrong sqrt",)),
    )
    with pytest.raises(InvalidInput, match="device: found 'opencl', but GPU 9000 was refused: wrong sqrt"):
        select_engine(SMALL, "opencl")
    assert select_engine(LARGE, "cpu") is None


def test_the_machine_decides_what_auto_means(machine, monkeypatch, gpu):
    monkeypatch.setenv("BENTRAY_DEVICE", "opencl")
    assert requested() == "opencl"
    assert select_engine(SMALL).device == gpu
    assert select_engine(SMALL, "cpu") is None
    monkeypatch.setenv("BENTRAY_DEVICE", "cpu")
    with pytest.raises(InvalidInput, match="BENTRAY_DEVICE=cpu"):
        select_engine(SMALL, "opencl")
    monkeypatch.setenv("BENTRAY_DEVICE", "")
    assert requested() == "auto"


@pytest.mark.parametrize(("name", "word"), [("BENTRAY_DEVICE", "gpu"), ("device", "cuda")])
def test_other_words_are_rejected(monkeypatch, name, word):
    monkeypatch.setenv("BENTRAY_DEVICE", word if name == "BENTRAY_DEVICE" else "auto")
    with pytest.raises(InvalidInput, match=f"{name}: found '{word}'; accepted: one of auto, cpu, opencl"):
        requested("auto" if name == "BENTRAY_DEVICE" else word)


def test_what_does_not_fit_the_memory_is_computed_here_or_refused_by_number(machine, monkeypatch, gpu):
    small = replace(gpu, memory_bytes=1000, buffer_bytes=400)
    monkeypatch.setattr(engine_selection, "find_devices", lambda: (small,))
    monkeypatch.setattr(engine_selection, "select_device", lambda: DeviceSelection(small, ()))
    assert select_engine(LARGE._replace(memory_bytes=1000, buffer_bytes=400)) is not None
    for work, words in (
        (LARGE._replace(memory_bytes=1001), "1001 bytes of device memory, and GPU 9000 has 1000"),
        (LARGE._replace(buffer_bytes=401), "401 bytes of one buffer, and GPU 9000 has 400"),
    ):
        assert select_engine(work) is None
        with pytest.raises(InvalidInput, match=words):
            select_engine(work, "opencl")
    assert misfit(LARGE._replace(memory_bytes=10**15), gpu) == "", "a driver that does not say"


def test_auto_does_not_test_a_processor_by_itself(monkeypatch, three, fresh):
    cpu = three[0]
    monkeypatch.setattr(engine_selection, "find_devices", lambda: (cpu,))
    for name in ("select_device", "self_test_result", "benchmark_engine"):
        monkeypatch.setattr(engine_selection, name, lambda *_: pytest.fail("tested"))
    assert select_engine(LARGE) is None
    # Once `bentray devices` has tested it, it is as good as another.
    monkeypatch.setattr(
        engine_selection, "stored_self_test_result", lambda device: SelfTestResult("", (1,), {})
    )
    monkeypatch.setattr(engine_selection, "stored_benchmark", lambda device, engine: TRIAL)
    monkeypatch.setattr(engine_selection, "open_session", Opened)
    assert select_engine(LARGE).device == cpu
    assert select_engine(SMALL) is None


@pytest.fixture
def slow_card(monkeypatch, gpu, fresh, tmp_path):
    """A card whose self-test passes and whose trials take a minute; gives the engines that were tried."""
    engines = tmp_path / "tried"
    (tmp_path / "slow_trial.py").write_text(
        f"import sys, time\nopen({str(engines)!r}, 'a').write(sys.argv[3] + ' ')\ntime.sleep(60)\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(device_benchmark, "MODULE", "slow_trial")
    monkeypatch.setattr(device_benchmark, "digest", lambda module: module)
    monkeypatch.setattr(engine_selection, "find_devices", lambda: (gpu,))
    monkeypatch.setattr(engine_selection, "self_test_result", lambda *_: SelfTestResult("", (1,), {}))
    monkeypatch.setattr(engine_selection, "AUTO_S", 0.6)
    monkeypatch.setattr(engine_selection, "LEAST_S", 0.1)
    return lambda: engines.read_text().split() if engines.exists() else []


def forget():
    """Forget results, like another process."""
    engine_selection._passing.cache_clear()
    engine_selection._tried.cache_clear()


def test_auto_waits_for_a_slow_trial_ten_seconds_and_says_so(slow_card, caplog, monkeypatch):
    assert device_benchmark.TIME_OUT_S > 60.0
    begun = time.monotonic()
    assert select_engine(LARGE) is None
    assert select_engine(LARGE) is None, "once per process"
    # A trial takes a minute.
    assert 0.5 < time.monotonic() - begun < 50.0
    # The seconds left depend on the load.
    lines = [re.sub(r"in [\d.]+ s;", "in 0.6 s;", record.getMessage()) for record in caplog.records]
    assert lines == [
        "GPU 9000 is tested once, for at most 1 s",
        "GPU 9000 is tried for field once, for at most 1 s",
        "GPU 9000 was tried for field: no answer in 0.6 s; compiled code computes; "
        "`bentray devices` tries it for longer",
    ]
    # Further processes try again, as kernels that were compiled meanwhile are in the cache; but not for ever.
    for _ in range(4):
        forget()
        assert select_engine(LARGE) is None
    assert slow_card() == ["field"] * 3
    assert select_engine(Work("sart", 1e9)) is None
    assert slow_card() == ["field"] * 3 + ["sart"]


def test_the_wait_for_a_card_is_ten_seconds_at_most():
    assert vars(engine_selection)["AUTO_S"] <= 10.0


def test_a_card_that_is_refused_is_named(slow_card, monkeypatch, caplog):
    monkeypatch.setattr(
        engine_selection, "self_test_result", lambda *_: SelfTestResult("double1: no answer in 10 s", (), {})
    )
    assert select_engine(LARGE) is None
    words = "GPU 9000 was refused: double1: no answer in 10 s; BENTRAY_DEVICE=cpu skips the test"
    assert caplog.records[-1].getMessage() == words
    assert slow_card() == []


def test_a_slow_self_test_leaves_no_time_for_a_trial(slow_card, monkeypatch):
    given = []

    def slow(device, time_out_s):
        given.append(time_out_s)
        time.sleep(time_out_s)
        return SelfTestResult("", (1,), {})

    monkeypatch.setattr(engine_selection, "self_test_result", slow)
    assert select_engine(LARGE) is None
    assert given == [pytest.approx(0.6, abs=0.1)]
    assert slow_card() == []


def test_a_lost_device_is_not_used_again(machine, gpu):
    select_engine(LARGE).lost = "Fast Platform:GPU 9000 failed: OUT_OF_RESOURCES"
    assert select_engine(LARGE) is None
    with pytest.raises(DeviceLostError, match="OUT_OF_RESOURCES"):
        select_engine(LARGE, "opencl")
    assert on_cpu(lambda: select_engine(LARGE, "opencl")) is None


@pytest.mark.opencl
def test_the_device_of_this_machine_can_be_requested():
    session = select_engine(Work("eikonal", 1.0), "opencl")
    assert isinstance(session, Session)
    assert session.device.memory_bytes >= session.device.buffer_bytes > 0
