"""Tests of a device in a child process, because drivers may abort, hang or compute wrong results."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from typing import Any

from .devices import Device


def answers_of(
    module: str, device: Device, arguments: Sequence[str], time_out_s: float
) -> tuple[list[dict[str, Any]], str]:
    """Run ``python -m module INDEX LABEL ARGUMENTS``.

    Args:
        module: prints one JSON object on a line for each answer.
        device: whose index and label are its first arguments.
        arguments: the others.
        time_out_s: after which the process is killed.

    Returns:
        The answers, and how the process ended.
    """
    command = [sys.executable, "-m", module, str(device.index), device.label, *arguments]
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as errors:
        try:
            code = subprocess.run(  # noqa: S603 - our own module
                command, stdout=out, stderr=errors, stdin=subprocess.DEVNULL, timeout=time_out_s, check=False
            ).returncode
            ending = f"ended by signal {-code}" if code < 0 else f"ended with exit code {code}"
        except subprocess.TimeoutExpired:
            ending = f"no answer in {time_out_s:.2g} s"
        out.seek(0)
        errors.seek(0)
        said = errors.read().strip().splitlines() or [""]
        # The error of a compiler is more useful than the last line, which may be a remark.
        last = ([line for line in said if "error:" in line.lower()] or said)[-1].strip()
        answers: list[dict[str, Any]] = []
        for line in out.read().splitlines():
            try:
                answer = json.loads(line)
            except ValueError:  # a driver's own remark
                continue
            if isinstance(answer, dict):
                answers.append(answer)
    return answers, f"{ending} ({last[:200]})" if last else ending
