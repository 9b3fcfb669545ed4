"""Sections of the formats of other programs, with their variables."""

from bentray_workers.foreign_scans.conversion import READERS

from .tables import table


def scan_readers() -> str:
    """One section for every reader of ``READERS``: container and source, then a table of its variables."""
    head = ("variable", "shape, type", "unit", "content", "required")
    sections = []
    for reader in READERS:
        rows = [(f"`{one.name}`", one.shape, one.unit, one.meaning, one.required) for one in reader.variables]
        sections += [f"### {reader.title}", reader.about, table(head, rows)]
    return "\n\n".join(sections)
