"""One trial: the tests of one module in a copy of the sources, with or without a planted fault."""

from __future__ import annotations

import math
import os
import re
import resource
import shutil
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

COPIED = ("kernels", "tests", "pyproject.toml")

# Devices have sources of their own; slow tests take longer than a whole file of others.
MARKERS = "not nightly and not opencl and not slow"

# hypothesis is imported before pytest starts.
QUIET = ("-W", "ignore::pytest.PytestAssertRewriteWarning")

# Compilation without vectorisation is faster. Numbers do not depend on it, as no kernel reorders sums.
FAST_COMPILATION = {"NUMBA_OPT": "1", "NUMBA_LOOP_VECTORIZE": "0", "NUMBA_SLP_VECTORIZE": "0"}


# Of one run of tests: a fault may make a list grow without end.
MEMORY_BYTES = 6 * 1024**3


@dataclass(frozen=True)
class Outcome:
    """How the tests ended.

    Attributes:
        ended: passed, failed (also where the tests cannot be collected) or timeout.
        test: first test that failed; "" without one.
        seconds: processor time, which does not depend on the load of the machine.
    """

    ended: str
    test: str
    seconds: float


def copy_of(root: Path, into: Path) -> None:
    """Copy the sources and the compiled kernels beside them; a copy of a copy takes hard links.

    Python and numba replace files and never change them in place, so the first copy stays as it is.
    """
    shutil.rmtree(into, ignore_errors=True)
    into.mkdir(parents=True)
    for name in COPIED:
        if (root / name).is_dir():
            shutil.copytree(root / name, into / name, copy_function=_linked)
        else:
            _linked(str(root / name), str(into / name))


def _linked(source: str, target: str) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def replace_text(path: Path, text: str) -> None:
    """Write a file anew: the old one may be a hard link of another copy."""
    path.unlink()
    path.write_text(text, encoding="utf-8")


def run_tests(folder: Path, files: Sequence[str], limit_s: float) -> Outcome:
    """Run test files of a copy until the first failure, in a process of their own.

    The process is forked: the libraries are imported once, in this process.

    Args:
        folder: the copy.
        files: of the tests, below it.
        limit_s: processor time after which the process is killed; ten times as long by the clock.
    """
    log = folder / "tests.log"
    child = os.fork()
    if child == 0:
        _run_here(folder, files, log, limit_s)
    try:
        status, seconds = _wait(child, time.perf_counter() + 10.0 * limit_s)
    except BaseException:
        # This program is being ended: the tests do not outlive it.
        os.killpg(child, signal.SIGKILL)
        raise
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) in (signal.SIGKILL, signal.SIGXCPU):
        return Outcome("timeout", "", seconds)
    text = log.read_text(encoding="utf-8", errors="replace")
    failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", text, re.MULTILINE)
    # No test at all is a mistake of this tool, not a killed fault.
    if os.WIFEXITED(status) and os.WEXITSTATUS(status) == 5:
        return Outcome("no tests", "", seconds)
    return Outcome("passed" if status == 0 else "failed", failed[1] if failed else "", seconds)


def _wait(child: int, end: float) -> tuple[int, float]:
    """The status of a process, killed at ``end``, and its processor time, s."""
    while True:
        done, status, used = os.wait4(child, os.WNOHANG)
        if done:
            return status, used.ru_utime + used.ru_stime
        if time.perf_counter() > end:
            os.killpg(child, signal.SIGKILL)
            end = float("inf")
        time.sleep(0.05)


def _run_here(folder: Path, files: Sequence[str], log: Path, limit_s: float) -> None:
    """Does not return."""
    code = 1
    try:
        os.setsid()
        output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(output, 1)
        os.dup2(output, 2)
        os.chdir(folder)
        sys.path[:0] = [str(folder / "kernels")]
        os.environ["PYTHONPATH"] = str(folder / "kernels")
        os.environ["BENTRAY_OPENCL_DEVICE"] = "none"
        os.environ.update(FAST_COMPILATION)
        from numba.core import config

        config.reload_config()
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES,) * 2)
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(limit_s),) * 2)
        import bentray_kernels

        assert Path(bentray_kernels.__file__).is_relative_to(folder), bentray_kernels.__file__
        import pytest

        code = int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", *QUIET, "-m", MARKERS, *files]))
    except BaseException as problem:
        print(f"ERROR {type(problem).__name__} {problem}", flush=True)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
