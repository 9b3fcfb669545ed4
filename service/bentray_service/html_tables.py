"""Records and figures as small tables in HTML, for notebooks."""

import base64
import html
from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any, ClassVar, TypeVar

from pydantic import BaseModel

# Characters of a value in a table.
LONGEST = 200
LEFT = "text-align:left"
# Fields of records that are for programs.
UNSHOWN = ("links", "history", "plan")


class ShownRecord(BaseModel):
    """A record that a notebook shows as a table.

    Attributes:
        columns: fields that a list of these records shows.
    """

    columns: ClassVar[tuple[str, ...]] = ()

    def _repr_html_(self) -> str:
        held = {name: getattr(self, name) for name in type(self).model_fields if name not in UNSHOWN}
        lists = {name: RecordList(value) for name, value in held.items() if _are_records(value)}
        rows = [(name, held[name]) for name in held if name not in lists and held[name] not in (None, "")]
        below = [records._repr_html_() for records in lists.values()]
        return figures_html(type(self).__name__.removesuffix("Record"), rows) + "".join(below)


Shown = TypeVar("Shown", bound=ShownRecord)


class RecordList(list[Shown]):
    """A list of records, shown as a table with one row each."""

    def _repr_html_(self) -> str:
        if not self:
            return "<em>none</em>"
        columns = self[0].columns
        return table_html(columns, [[getattr(record, name) for name in columns] for record in self])


def figures_html(title: str, rows: Iterable[tuple[str, Any]]) -> str:
    """A table of names and values below a title."""
    lines = [
        f'<tr><th style="{LEFT}">{_cell(name)}</th><td style="{LEFT}">{_cell(value)}</td></tr>'
        for name, value in rows
    ]
    return f"<div><strong>{_cell(title)}</strong><table>{''.join(lines)}</table></div>"


def table_html(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A table with a head."""
    head = "".join(f'<th style="{LEFT}">{_cell(name)}</th>' for name in columns)
    lines = ["".join(f'<td style="{LEFT}">{_cell(value)}</td>' for value in row) for row in rows]
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def picture_html(png: bytes, alt: str) -> str:
    """A picture as part of the page."""
    text = base64.b64encode(png).decode()
    return f'<img alt="{html.escape(alt)}" src="data:image/png;base64,{text}" style="max-width:100%">'


def _are_records(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], ShownRecord)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    text = f"{value:%Y-%m-%d %H:%M}" if isinstance(value, datetime) else str(value)
    return html.escape(text if len(text) <= LONGEST else text[: LONGEST - 1] + "…")
