"""Checks of OFF files against their counts, with the first wrong vertex or face."""

from __future__ import annotations

import re

from bentray_kernels.errors import InvalidInput

HEADERS = (b"OFF", b"COFF", b"NOFF", b"CNOFF")

# Length of a line in an error message.
SHOWN = 60


def check_off(data: bytes) -> None:
    """Reject an OFF whose lines do not match its counts.

    Args:
        data: the whole file, which begins with one of ``HEADERS``.

    Raises:
        InvalidInput: ``file`` for invalid counts and for missing lines; ``vertices`` and ``faces`` for the
            first invalid line.
    """
    plain = re.sub(rb"#[^\n]*", b"", data)
    lines = [line for line in (one.strip() for one in plain.splitlines()) if line]
    rest = lines[0].split(maxsplit=1)[1:] + lines[1:]
    vertices, faces = _counts(rest[0] if rest else b"")
    if len(rest) - 1 < vertices + faces:
        found = f"{len(rest) - 1} lines of the {vertices} vertices and {faces} faces of its counts"
        raise InvalidInput("file", f"an OFF file that ends too soon: {found}", "a whole OFF file")
    for k, line in enumerate(rest[1 : 1 + vertices]):
        if not _numbers(line.split()[:3]):
            raise InvalidInput("vertices", f"{_shown(line)} as vertex {k}", "three numbers, x y z")
    for k, line in enumerate(rest[1 + vertices : 1 + vertices + faces]):
        if not _face(line.split(), vertices):
            accepted = f"the number of corners, 3 or more, and their vertices, from 0 to {vertices - 1}"
            raise InvalidInput("faces", f"{_shown(line)} as face {k}", accepted)


def _counts(line: bytes) -> tuple[int, int]:
    words = line.split()
    if len(words) < 2 or not all(word.isdigit() and len(word) < 19 for word in words[:2]):
        raise InvalidInput("file", f"an OFF file with {_shown(line)} for its counts", "vertices faces edges")
    return int(words[0]), int(words[1])


def _numbers(words: list[bytes]) -> bool:
    try:
        return len([float(word) for word in words]) == 3
    except ValueError:
        return False


def _face(words: list[bytes], vertices: int) -> bool:
    if not words[0].isdigit():
        return False
    count = int(words[0][:9])
    corners = words[1 : 1 + count]
    return 3 <= len(corners) == count and all(
        word.isdigit() and int(word[:19]) < vertices for word in corners
    )


def _shown(line: bytes) -> str:
    return repr(line[:SHOWN].decode(errors="replace"))
