"""Checks of OFF files for what trimesh leaves out: missing lines, and faces without their corners."""

from __future__ import annotations

import re

from bentray_kernels.errors import InvalidInput

HEADERS = (b"OFF", b"COFF", b"NOFF", b"CNOFF")

# Length of a line in an error message.
SHOWN = 60


def plain_off(data: bytes) -> bytes:
    """An OFF without comments, with which trimesh loses lines; one that it would read in part is rejected.

    Args:
        data: the whole file, which begins with one of ``HEADERS``.

    Returns:
        The same text without comments.

    Raises:
        InvalidInput: ``file`` for missing lines; ``faces`` for the first one without its corners.
        ValueError, IndexError: for counts that are no numbers.
    """
    plain = re.sub(rb"#[^\n]*", b"", data)
    lines = [words for words in (line.split() for line in plain.splitlines()) if words]
    counts, *rows = [lines[0][1:], *lines[1:]] if lines[0][1:] else lines[1:]
    vertices, faces = int(counts[0]), int(counts[1])
    if min(vertices, faces) < 0 or len(rows) < vertices + faces:
        given = f"{len(rows)} lines of the {vertices} vertices and {faces} faces of its counts"
        raise InvalidInput("file", f"an OFF file that ends too soon: {given}", "a whole OFF file")
    for number, words in enumerate(rows[vertices : vertices + faces]):
        if not 3 <= int(words[0]) < len(words):
            given = f"{b' '.join(words)[:SHOWN].decode(errors='replace')!r} as face {number}"
            raise InvalidInput("faces", given, "the number of corners, 3 or more, and their vertices")
    return plain
