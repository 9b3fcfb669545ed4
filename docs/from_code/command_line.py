"""The commands of `bentray` with their options, from the `--help` texts."""

import inspect
from typing import Any

import typer

from bentray_service.cli import app

from .tables import table


def commands() -> str:
    """One section per command, in the order of `bentray --help`."""
    known = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    return "\n\n".join(_section(name, command) for name, command in known.items())


def _section(name: str, command: Any) -> str:
    context = command.make_context(name, [], resilient_parsing=True)
    usage = " ".join(["bentray", name, *command.collect_usage_pieces(context)])
    parts = [f"## {name}", f"```text\n{usage}\n```", _prose(command.help or "")]
    rows = [row for param in command.get_params(context) if (row := _row(param, context))]
    parts.append(table(("argument or option", "default", "meaning"), rows))
    if hasattr(command, "commands"):
        parts += [
            _section(f"{name} {one}", command.commands[one]).replace("## ", "### ", 1)
            for one in command.commands
        ]
    return "\n\n".join(part for part in parts if part)


def _prose(text: str) -> str:
    """The help text without terminal markup; examples as code blocks."""
    paragraphs = []
    for paragraph in inspect.cleandoc(text).replace("\b", "").replace("\f", "").split("\n\n"):
        words = " ".join(paragraph.split())
        before, example, line = words.partition("Example: ")
        if before.strip():
            paragraphs.append(_plain(before.strip()))
        if example:
            paragraphs.append(f"```text\n{line.strip()}\n```")
    return "\n\n".join(paragraphs)


def _row(param: Any, context: Any) -> tuple[str, str, str] | None:
    if getattr(param, "hidden", False):
        return None
    names = [param.name.upper()]
    if param.param_type_name == "option":
        names = [*param.opts, *param.secondary_opts]
    opts = ", ".join(f"`{name}`" for name in names)
    if "|" in (accepted := param.display_type_rich(context) or ""):
        opts += f" `{accepted}`"
    return opts, _default(param, context), _plain(param.help or "")


def _default(param: Any, context: Any) -> str:
    if param.required:
        return "required"
    if isinstance(getattr(param, "show_default", None), str):
        return _plain(param.show_default)
    value = param.get_default(context)
    if value is None or value is False or value == ():
        return ""
    if value is True:
        return f"`{param.opts[0]}`"
    value = getattr(value, "value", value)
    return f"`{' '.join(map(str, value)) if isinstance(value, list | tuple) else value}`"


def _plain(text: str) -> str:
    """Text with escaped angle brackets, stars and underscores."""
    return text.replace("<", "&lt;").replace("*", "\\*").replace("_", "\\_")
