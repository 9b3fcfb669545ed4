"""Every command has a full help text, and showing it imports no heavy module."""

from functools import cache
from typing import Any

import pytest
import typer

from bentray_service.cli import app

from .conftest import Run


@cache
def named() -> dict[str, Any]:
    """Every command by its words, those of groups too, as ``keys create``."""
    found = {}
    for name, command in typer.main.get_command(app).commands.items():  # type: ignore[attr-defined]
        inner = getattr(command, "commands", None)
        found |= {name: command} if inner is None else {f"{name} {one}": own for one, own in inner.items()}
    return found


COMMANDS = sorted(named())


@pytest.mark.parametrize("command", COMMANDS)
def test_help_fits_a_narrow_terminal_and_gives_an_example_that_parses(
    bentray: Run, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    words = command.split()
    said = bentray(*words, "--help")
    example = said.stdout.split("Example:")[1].split("\n\n")[0].split()
    assert example[: len(words) + 1] == ["bentray", *words]
    named()[command].make_context(command, list(example[len(words) + 1 :]))
    # Withdrawn options are hidden.
    shown_params = [param for param in named()[command].params if not getattr(param, "hidden", False)]
    options = [word for param in shown_params for word in (*param.opts, *param.secondary_opts)]
    shown = said.stdout.replace(",", " ").split()
    assert [word for word in options if word.startswith("-") and word not in shown] == []


@pytest.mark.parametrize(
    ("group", "panels"),
    [
        ("", ["Reconstruct", "Data", "Service", "Administration"]),
        *((group, ["Commands"]) for group in ("keys", "projects", "webhooks")),
    ],
)
def test_summaries_of_commands_stand_in_groups_and_are_not_cut(
    bentray: Run, monkeypatch: pytest.MonkeyPatch, group: str, panels: list[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    said = bentray(*group.split(), "--help").stdout
    assert [line[:-1] for line in said.splitlines() if line.endswith(":") and line[0] != " "] == [
        "Options",
        *panels,
    ]
    listed = said.partition("\nOptions:")[2]
    assert len(listed.split()) > 10
    assert "..." not in listed


@pytest.mark.parametrize(
    ("command", "choices"),
    [
        ("reconstruct", "--picker <aic|threshold|energy-ratio|sta-lta|correlation|matched>"),
        ("reconstruct", "--rays <curved|straight>"),
        ("correct", "--times-in <s|ms|us|ns>"),
        ("quality", "--picker <aic|threshold|energy-ratio|sta-lta|correlation|matched>"),
        ("render", "--camera <orthographic|perspective>"),
    ],
)
def test_choices_are_shown_as_choices(
    bentray: Run, monkeypatch: pytest.MonkeyPatch, command: str, choices: str
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    said = bentray(command, "--help").stdout
    assert choices in said
    assert max(map(len, said.partition("Options:")[2].splitlines())) <= 80


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_is_explained(command: str) -> None:
    params = named()[command].params
    assert [param.name for param in params if not (param.help or param.hidden)] == []
    assert "--json" in [option for param in params for option in param.opts]
