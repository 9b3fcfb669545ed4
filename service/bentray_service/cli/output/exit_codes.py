"""Groups of commands, and exit codes: 0 success, 1 failure, 2 invalid input, 3 doubtful, 130 after Ctrl-C."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

# Longer than every summary: it is never cut.
WHOLE = 1_000
WORK_FAILED = 1
BAD_INPUT = 2
DOUBTFUL = 3
INTERRUPTED = 130


class CommandList(TyperGroup):
    """A group of commands; its help and theirs can be read and copied on a terminal of 80 columns."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        for command in self.commands.values():
            if command.help is not None:
                # After \b lines stay as they are; else they are broken at hyphens, within options too.
                command.help = command.help.replace("\n\nExample:", "\n\n\b\nExample:")

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands with their whole summaries, below the names of their panels."""
        panels: dict[str, list[tuple[str, str]]] = {}
        for name, command in self.commands.items():
            rows = panels.setdefault(getattr(command, "rich_help_panel", None) or "Commands", [])
            rows.append((name, command.get_short_help_str(WHOLE)))
        for panel, rows in panels.items():
            with formatter.section(panel):
                formatter.write_dl(rows)


class WorkFailed(Exception):  # noqa: N818 - the command's ending, not a fault of the program
    """The work failed although the input was valid; the message is for the user."""


class DoubtfulResult(Exception):  # noqa: N818 - the command's ending, not a fault of the program
    """The result was written, but says itself that it is doubtful; the message is for the user."""


AcceptDoubtful = Annotated[
    bool,
    typer.Option(
        "--accept-doubtful",
        help="Exit with code 0 although a result is doubtful: an image cut off by the speed bounds, or one "
        "that does not explain the times. Without it the code is 3; the files are written in both cases.",
    ),
]


class Commands(CommandList):
    """The group of all commands; converts errors to one line on stderr and an exit code.

    Unexpected errors are shown with a traceback, with exit code 1.
    """

    def main(self, *args: Any, **options: Any) -> Any:
        from bentray_kernels.errors import InvalidInput

        options["standalone_mode"] = False
        try:
            code = super().main(*args, **options)
        except InvalidInput as error:
            _end(str(error), WORK_FAILED if _unavailable(error) else BAD_INPUT)
        except WorkFailed as error:
            _end(str(error), WORK_FAILED)
        except DoubtfulResult as error:
            _end(str(error), DOUBTFUL)
        except typer.TyperException as error:
            context = getattr(error, "ctx", None)
            hint = f" (see {context.command_path} --help)" if context is not None else ""
            _end(error.format_message().rstrip(".") + hint, error.exit_code)
        except MemoryError as error:
            _end(f"out of memory: {str(error) or 'no details'}", WORK_FAILED)
        except OSError as error:
            _end(f"{error.filename or 'the system'}: {error.strerror or error}", WORK_FAILED)
        if code == INTERRUPTED:
            _end("interrupted", INTERRUPTED)
        sys.exit(code if isinstance(code, int) else 0)


def _unavailable(error: Exception) -> bool:
    """Whether database or storage are unavailable."""
    # Their errors need SQLAlchemy, which a command that raised another error has not loaded.
    if f"{__package__.partition('.')[0]}.errors" not in sys.modules:
        return False
    from ...errors import DatabaseUnavailable, StorageFull, StorageUnavailable

    return isinstance(error, DatabaseUnavailable | StorageUnavailable | StorageFull)


def end_doubtful(doubtful: int, results: int, *, accepted: bool) -> None:
    """End a command whose results are doubtful, after they were written and shown.

    Raises:
        DoubtfulResult: unless ``accepted``, or if none of the ``results`` is ``doubtful``.
    """
    if doubtful and not accepted:
        which = "the result is" if results == 1 else f"{doubtful} of {results} results are"
        raise DoubtfulResult(f"{which} doubtful, for the reasons above (--accept-doubtful: exit code 0)")


@contextmanager
def client_errors() -> Iterator[None]:
    """Convert errors of the client to invalid input or failed work."""
    from bentray_kernels.errors import InvalidInput

    from ...client import ClientError

    try:
        yield
    except ClientError as error:
        refused = error.status is not None and 400 <= error.status < 500
        if refused and error.field and error.found and error.accepted:
            raise InvalidInput(error.field, error.found, error.accepted) from error
        raise WorkFailed(str(error)) from error


def _end(message: str, code: int) -> NoReturn:
    line = " ".join(message.split())
    sys.stderr.write(f"bentray: {line}\n")
    sys.exit(code)
