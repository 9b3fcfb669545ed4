"""Checks of untrusted zips: directory against contents, before any member is decompressed."""

from __future__ import annotations

import re
import struct
import zipfile

from bentray_kernels.errors import InvalidInput

from .bounded_reading import LARGEST_TOTAL

WHOLE = "a zip as numpy.savez or savez_compressed writes it"

# Largest compression ratio of deflate is 1032.
PACKING = 1100.0

# Flags: encrypted; patched; strongly encrypted; masked directory.
SECRET = 1 << 0 | 1 << 5 | 1 << 6 | 1 << 13
# Flag: sizes follow the data.
DESCRIPTOR = 1 << 3
LOCAL = struct.Struct("<4s5H3I2H")
IN_64_BITS = 0xFFFFFFFF

# Names of arrays with groups; never a path of this machine.
PART = r"(?!\.\.?(?:/|$))[\w. -]+"
NAME = re.compile(f"{PART}(?:/{PART})*/?")
LONGEST_NAME = 200


def check_zip(archive: zipfile.ZipFile, most_members: int) -> None:
    """Reject a zip with an inconsistent directory.

    Rejected names are not repeated: they are untrusted.

    Args:
        archive: open.
        most_members: largest number of members.

    Raises:
        InvalidInput: naming ``file``.
    """
    members = archive.infolist()
    if len(members) > most_members:
        raise InvalidInput("file", f"{len(members)} members", f"at most {most_members}")
    if len({member.filename for member in members}) < len(members):
        raise InvalidInput("file", "a zip with two members of one name", WHOLE)
    total = 0
    for number, member in enumerate(members):
        _check_member(number, member)
        total += member.file_size
    if total > LARGEST_TOTAL:
        raise InvalidInput("file", f"{total} bytes unpacked", f"at most {LARGEST_TOTAL} bytes")
    _check_offsets(archive, members)


def plain_name(name: str) -> bool:
    """Whether a name is valid for an array, and safe for a message."""
    return len(name) <= LONGEST_NAME and NAME.fullmatch(name) is not None


def _check_member(number: int, member: zipfile.ZipInfo) -> None:
    if not plain_name(member.filename):
        raise InvalidInput("file", f"member {number} with a name that no array has", WHOLE)
    if member.flag_bits & SECRET:
        raise InvalidInput("file", f"member {number} with a password", WHOLE)
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise InvalidInput("file", f"member {number} of packing {member.compress_type}", WHOLE)
    packed, size = member.compress_size, member.file_size
    stored = member.compress_type == zipfile.ZIP_STORED
    if (stored and packed != size) or size > PACKING * packed + 4096:
        given = f"member {number} of {size} bytes, of which {packed} are stored"
        raise InvalidInput("file", given, "data that are in the file")


def _check_offsets(archive: zipfile.ZipFile, members: list[zipfile.ZipInfo]) -> None:
    """Check that members match the directory and do not overlap."""
    raw = archive.fp
    assert raw is not None
    end = 0
    for number, member in sorted(enumerate(members), key=lambda numbered: numbered[1].header_offset):
        at = member.header_offset
        raw.seek(max(at, 0))
        head = raw.read(LOCAL.size)
        if at < end or len(head) < LOCAL.size:
            raise InvalidInput("file", f"member {number} at byte {at}, in another or beyond the end", WHOLE)
        mark, _, flags, packing, _, _, crc, packed, size, name_bytes, extra_bytes = LOCAL.unpack(head)
        same = mark == b"PK\x03\x04" and packing == member.compress_type and not flags & SECRET
        pairs = ((crc, member.CRC), (packed, member.compress_size), (size, member.file_size))
        if not flags & DESCRIPTOR:
            same &= all(own in (theirs, IN_64_BITS) for own, theirs in pairs)
        if not same:
            raise InvalidInput("file", f"member {number}, which differs from the directory", WHOLE)
        end = at + LOCAL.size + name_bytes + extra_bytes + member.compress_size
    if end > archive.start_dir:
        raise InvalidInput("file", f"members up to byte {end} of {archive.start_dir}", WHOLE)
