"""Exit codes: 0 done, 1 failed, 2 bad input, 3 doubtful; one line on stderr without a traceback."""

import subprocess
import sys

import pytest
import typer
from typer.testing import CliRunner, Result

from bentray_kernels.errors import InvalidInput
from bentray_service.cli.output.exit_codes import Commands, DoubtfulResult, WorkFailed, client_errors
from bentray_service.client import ClientError
from bentray_service.client.errors import from_problem
from bentray_service.web.problem import Problem

from ..conftest import Run


def ending(raised: BaseException | None) -> Result:
    """Exit of a command that raises ``raised``."""
    app = typer.Typer(cls=Commands)

    @app.command()
    def work() -> None:
        if raised is not None:
            raise raised

    @app.callback()
    def _group() -> None: ...

    return CliRunner().invoke(app, ["work"])


@pytest.mark.parametrize(
    ("raised", "code", "line"),
    [
        (None, 0, ""),
        (InvalidInput("nodes", 3, "16 to 2048"), 2, "bentray: nodes: found 3; accepted: 16 to 2048\n"),
        (WorkFailed("no worker\nis left"), 1, "bentray: no worker is left\n"),
        (PermissionError(13, "Permission denied", "out/x"), 1, "bentray: out/x: Permission denied\n"),
        (MemoryError("9 GiB"), 1, "bentray: out of memory: 9 GiB\n"),
        (MemoryError(), 1, "bentray: out of memory: no details\n"),
        (OSError("odd"), 1, "bentray: the system: odd\n"),
        (DoubtfulResult("cut off"), 3, "bentray: cut off\n"),
        (KeyboardInterrupt(), 130, "bentray: interrupted\n"),
        (typer.Exit(3), 3, ""),
    ],
)
def test_each_ending_has_its_code_and_one_line(raised: BaseException | None, code: int, line: str) -> None:
    result = ending(raised)
    assert (result.exit_code, result.stderr, result.stdout) == (code, line, "")


def test_a_fault_of_the_program_keeps_its_traceback() -> None:
    assert isinstance(ending(ZeroDivisionError()).exception, ZeroDivisionError)


def refused(status: int, title: str, **fault: str) -> ClientError:
    return from_problem(Problem(type="", title=title, status=status, detail="", **fault))


@pytest.mark.parametrize(
    ("error", "becomes", "words"),
    [
        (
            refused(422, "t", field="tx", found="9", accepted="0 to 3"),
            InvalidInput,
            "tx: found 9",
        ),
        (refused(503, "busy", field="workers", found="0", accepted="1"), WorkFailed, "busy"),
        (ClientError("no answer from there"), WorkFailed, "no answer from there"),
        (refused(404, "gone"), WorkFailed, "gone"),
    ],
)
def test_service_responses_map_to_exit_codes(
    error: ClientError, becomes: type[Exception], words: str
) -> None:
    with pytest.raises(becomes, match=words), client_errors():
        raise error


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["reconstruct"], "Missing argument 'file' (see bentray reconstruct --help)"),
        (["recon"], "No such command 'recon'. Did you mean 'reconstruct'? (see bentray --help)"),
        (["simulate", "-o", "x.h5", "--nodes", "many"], "Invalid value for '--nodes'"),
        (["simulate", "--colour"], "No such option: --colour"),
    ],
)
def test_invalid_arguments_exit_with_code_2_and_one_line(bentray: Run, words: list[str], line: str) -> None:
    result = bentray(*words, code=2)
    assert result.stderr.count("\n") == 1
    assert result.stderr.startswith(f"bentray: {line}")


@pytest.mark.parametrize(("words", "code"), [(["--help"], 0), ([], 0), (["--version"], 0), (["nothing"], 2)])
def test_the_process_really_ends_with_the_code(words: list[str], code: int) -> None:
    command = [sys.executable, "-m", "bentray_service.cli", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == code
    assert "Traceback" not in done.stderr
    assert bool(done.stdout) == (code == 0)
