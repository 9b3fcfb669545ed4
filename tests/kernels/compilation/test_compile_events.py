"""Events of compilation: counts, and one process at a time for each kernel."""

import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from types import SimpleNamespace

import pytest
from numba.core import event

from bentray_kernels.compilation import compile_events
from bentray_kernels.compilation.compile_events import (
    Compilation,
    CompiledMeanwhile,
    CompileEvents,
    claim,
    needed,
)
from bentray_kernels.compilation.compiled import Kernel, compilation

from ...clock import Clock

SOURCE = """
from bentray_kernels.compilation.compiled import kernel

@kernel
def first(x):
    return x + 1.0

@kernel
def second(x):
    return first(x) + first(2.0 * x)
"""


@pytest.fixture
def fresh(tmp_path):
    """Kernels in a file of their own, so that no earlier run has stored them."""
    (tmp_path / "fresh.py").write_text(SOURCE)
    spec = spec_from_file_location("fresh", tmp_path / "fresh.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _of(function):
    return event.Event(
        compile_events.KIND, event.EventStatus.START, {"dispatcher": SimpleNamespace(py_func=function)}
    )


def test_kernels_are_counted_with_those_that_the_call_needs():
    clock = SimpleNamespace(now=100.0)
    events = CompileEvents(lambda function: function, lambda _: None, lambda: clock.now)
    outer, inner, other = _of(3), _of(0), _of(2)
    assert events.now() == Compilation(0, 0, active=False)
    seen = []
    for step, of in (("start", outer), ("start", inner), ("end", inner), ("start", inner), ("end", inner)):
        getattr(events, f"on_{step}")(of)
        seen.append(events.now())
    events.on_end(outer)
    assert seen == [Compilation(done, 3, active=True) for done in (0, 0, 1, 1, 2)]
    assert events.now() == Compilation(3, 3, active=False)
    events.on_start(other)
    assert events.now() == Compilation(3, 5, active=True)
    events.on_end(other)
    clock.now += 60.0
    events.on_start(other)
    assert events.now() == Compilation(0, 2, active=True), "counted anew after a pause"
    events.on_end(other)


def test_the_kernels_of_a_call_are_found_in_its_code(fresh):
    assert needed(fresh.second.py_func, Kernel) == {fresh.first}


def test_compilation_is_counted_while_it_lasts(fresh):
    seen = []

    class Witness(event.Listener):
        def on_start(self, event):
            seen.append(compilation())

        def on_end(self, event):
            seen.append(compilation())

    with event.install_listener(compile_events.KIND, Witness()):
        assert fresh.second(1j) == 2 + 3j
    assert [counts.active for counts in seen] == [True, True, True, False]
    assert [counts.done - seen[0].done for counts in seen] == [0, 0, 1, 2]
    assert seen[0].total - seen[0].done >= 1


HOLD = """
import sys
from bentray_kernels.compilation.compile_events import claim
held, waited = claim("kernel of a test")
print(waited, flush=True)
sys.stdin.read()
"""


def test_a_kernel_that_another_process_compiles_is_waited_for(monkeypatch, fresh):
    monkeypatch.setattr(compile_events, "STORE_S", 0.0)
    events = CompileEvents(lambda _: 1, lambda _: "kernel of a test")
    with subprocess.Popen(
        [sys.executable, "-c", HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout.readline() == "False\n"
        assert claim("another kernel")[1] is False

        clock = Clock()

        def release(seconds):
            clock.now += seconds + 1.0
            if other.poll() is None:
                other.communicate()

        monkeypatch.setattr(compile_events, "time", SimpleNamespace(sleep=release, monotonic=clock))
        with pytest.raises(CompiledMeanwhile):
            events.on_start(_of(fresh.first.py_func))
        events.on_end(_of(fresh.first.py_func))
    assert events.now() == Compilation(0, 0, active=False), "loaded from the cache, not compiled"
    events.on_start(_of(fresh.first.py_func))
    events.on_end(_of(fresh.first.py_func))
    assert events.now().done == 1


def test_a_call_is_repeated_after_another_process_has_compiled_its_kernel(monkeypatch, fresh):
    refusals = [CompiledMeanwhile("kernel"), OSError(28, "No space left on device")]

    def called(x):
        if refusals:
            raise refusals.pop(0)
        return -x

    monkeypatch.setattr(fresh.first, "_called", called)
    assert fresh.first(2) == -2
    assert refusals == []
