"""Checks of OBJ files: faces and vertices, with the line number of the first error."""

from __future__ import annotations

import re

from bentray_kernels.errors import InvalidInput

# Length of a line in an error message.
SHOWN = 60

# Continued lines; faces of fewer than three corners; vertices of fewer than three numbers.
CONTINUED = re.compile(rb"\\[ \t]*\r?\n")
SHORT_FACE = re.compile(rb"^[ \t]*f(?:[ \t]+[^\s#]+){0,2}[ \t]*(?:#.*)?\r?$", re.MULTILINE)
SHORT_VERTEX = re.compile(rb"^[ \t]*v(?:[ \t]+[^\s#]+){0,2}[ \t]*(?:#.*)?\r?$", re.MULTILINE)


def check_obj(data: bytes) -> None:
    """Reject an OBJ with an incomplete face, which readers skip, or an incomplete vertex.

    Args:
        data: the whole file.

    Raises:
        InvalidInput: ``faces`` or ``vertices``, with the line.
    """
    text = CONTINUED.sub(b" ", data)
    for field, pattern, accepted in (
        ("vertices", SHORT_VERTEX, "three numbers, x y z"),
        ("faces", SHORT_FACE, "three corners or more"),
    ):
        match = pattern.search(text)
        if match is not None:
            line = text.count(b"\n", 0, match.start()) + 1
            shown = match[0].strip()[:SHOWN].decode(errors="replace")
            raise InvalidInput(field, f"{shown!r} in line {line}", accepted)
