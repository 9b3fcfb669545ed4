"""The table of export formats."""

from bentray_workers.files.export.registry import FORMATS

from .tables import table


def export_formats() -> str:
    """One row for every format: suffixes, name, content, positions, and what ``bentray`` reads of it."""
    head = ("suffix", "`format` of REST", "format", "content", "positions", "read again")
    rows = [
        (
            ", ".join(f"`{suffix}`" for suffix in form.suffixes),
            f"`{name}`",
            *(form.title, form.content, form.positions, form.read_again),
        )
        for name, form in FORMATS.items()
    ]
    return table(head, rows)
