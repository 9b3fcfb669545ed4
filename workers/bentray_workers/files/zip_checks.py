"""Untrusted zips: checks of the directory, which ``zipfile`` compares members with; bounded members."""

import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import NamedTemporaryFile

from bentray_kernels.errors import InvalidInput

from .bounded_reading import LARGEST_TOTAL
from .damage import rejecting_damage

WHOLE = "a zip as numpy.savez or savez_compressed writes it"

# Largest compression ratio of deflate is 1032.
PACKING = 1100.0

# Flags: encrypted; patched; strongly encrypted; masked directory.
SECRET = 1 << 0 | 1 << 5 | 1 << 6 | 1 << 13
# Names of arrays with groups; never a path of this machine.
PART = r"(?!\.\.?(?:/|$))[\w. -]+"
NAME = re.compile(f"{PART}(?:/{PART})*/?")
LONGEST_NAME = 200


def check_zip(archive: zipfile.ZipFile, most_members: int) -> None:
    """Reject a zip whose directory names, packs or sizes members as no program of arrays does.

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
    # Bombs of many members share their data.
    places = sorted((member.header_offset, member.compress_size) for member in members)
    for (begin, size), end in zip(places, [*(at for at, _ in places[1:]), archive.start_dir], strict=True):
        if begin + size > end:
            raise InvalidInput("file", "a zip with a member within another, or beyond the end", WHOLE)


def read_member(archive: zipfile.ZipFile, name: str, most: int) -> bytes:
    """A member, decompressed up to ``most`` bytes.

    Raises:
        InvalidInput: naming it, for more bytes, others than the directory says, or damaged ones.
    """
    with rejecting_damage(name, "a whole zip"), archive.open(name) as packed:
        data = packed.read(most + 1)
    declared = archive.getinfo(name).file_size
    if len(data) > most or len(data) != declared:
        raise InvalidInput(name, f"{len(data)} bytes, {declared} in the directory", f"at most {most}")
    return data


@contextmanager
def member_file(archive: zipfile.ZipFile, name: str, most: int, scratch: Path) -> Iterator[Path]:
    """A member as a temporary file in ``scratch``; raises as ``read_member``."""
    with NamedTemporaryFile(dir=scratch, suffix=Path(name).suffix) as file:
        file.write(read_member(archive, name, most))
        file.flush()
        yield Path(file.name)


@contextmanager
def naming(member: str) -> Iterator[None]:
    """Add the name of the member to errors."""
    try:
        yield
    except InvalidInput as error:
        if error.field.startswith(member):
            raise
        raise InvalidInput(f"{member}: {error.field}", error.value, error.accepted) from None


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
