"""Checks of OBJ files: faces and vertices, with the line number of the first error; relative indices."""

from __future__ import annotations

import re

from bentray_kernels.errors import InvalidInput

# Length of a line in an error message.
SHOWN = 60

# Continued lines; faces of fewer than three corners; vertices of fewer than three numbers.
CONTINUED = re.compile(rb"\\[ \t]*\r?\n")
SHORT = re.compile(rb"^[ \t]*([vf])(?:[ \t]+[^\s#]+){0,2}[ \t]*(?:#.*)?\r?$", re.MULTILINE)
ACCEPTED = {b"v": ("vertices", "three numbers, x y z"), b"f": ("faces", "three corners or more")}
# Vertices, and faces with their corners; a corner is a vertex, and after a slash texture and normal.
RECORD = re.compile(rb"^[ \t]*(?:(v)[ \t]|f[ \t]+([^\r\n#]*))", re.MULTILINE)
# A corner that counts vertices back from its face, or from 0.
RELATIVE = re.compile(rb"^[ \t]*f[^\r\n#]*[ \t](?:-|0+(?![0-9]))", re.MULTILINE)


def plain_obj(data: bytes) -> bytes:
    """An OBJ whose faces count vertices from 1, without what readers take for other vertices.

    Args:
        data: the whole file.

    Returns:
        The same text, where faces count vertices back from their line (-1: the last one so far) with the
        vertices alone: readers count back from the end of the file.

    Raises:
        InvalidInput: ``faces`` or ``vertices``, with the line: an incomplete face, which readers skip, an
            incomplete vertex, or a face of a vertex that is not there.
    """
    text = CONTINUED.sub(b" ", data)
    if (match := SHORT.search(text)) is not None:
        field, accepted = ACCEPTED[match[1]]
        raise InvalidInput(field, _shown(text, match), accepted)
    return _absolute(text) if RELATIVE.search(text) else data


def _absolute(text: bytes) -> bytes:
    """Replace relative indices of vertices."""
    before = 0

    def replaced(record: re.Match[bytes]) -> bytes:
        nonlocal before
        if record[1]:
            before += 1
            return record[0]
        numbers = [int(corner.partition(b"/")[0]) for corner in record[2].split()]
        if 0 in numbers or -min(numbers) > before:
            raise InvalidInput(
                "faces", _shown(text, record), f"vertices from 1, or from -1 to -{before} back from the face"
            )
        return b"f " + b" ".join(b"%d" % (n if n > 0 else before + 1 + n) for n in numbers)

    return RECORD.sub(replaced, text)


def _shown(text: bytes, line: re.Match[bytes]) -> str:
    number = text.count(b"\n", 0, line.start()) + 1
    return f"{line[0].strip()[:SHOWN].decode(errors='replace')!r} in line {number}"
