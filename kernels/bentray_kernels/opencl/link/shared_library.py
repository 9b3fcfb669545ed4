"""A minimal linker for one object file: the only PoCL of the Python index runs `ld`, which many systems lack.

``ld … -o LIBRARY … OBJECT …`` makes a shared library for x86-64 Linux of one relocatable object as LLVM makes
it of a kernel: code, constants, data, and calls of functions that the process has. Options and libraries are
ignored; what is undefined is looked up in the process when the library is loaded. Anything else that an
object may hold (thread-local data, absolute 32-bit addresses) ends with an error. Imports nothing but the
standard library, since it starts once a kernel. Formats: System V ABI, AMD64 supplement, chapters 4 and 5.
"""

import struct
import sys
from dataclasses import dataclass, field
from pathlib import Path

PAGE = 0x1000
HEADER, SEGMENT, SECTION, SYMBOL, RELOCATION = (
    "<16sHHIQQQIHHHHHH",
    "<IIQQQQQQ",
    "<IIQQQQIIQQ",
    "<IBBHQQ",
    "<QQq",
)
WRITE, ALLOC, NOBITS, SYMTAB, RELA = 1, 2, 8, 2, 4
UNDEFINED, ABSOLUTE, COMMON, LOCAL = 0, 0xFFF1, 0xFFF2, 0
# Relocations: of the object, and of the library for the dynamic linker.
R_64, R_PC32, R_PLT32, R_GOTPCREL, R_PC64, R_GOTPCRELX, R_REX_GOTPCRELX = 1, 2, 4, 9, 24, 41, 42
R_GLOB_DAT, R_RELATIVE = 6, 8
LOAD, DYNAMIC, GNU_STACK = 1, 2, 0x6474E551


@dataclass(frozen=True)
class Symbol:
    name: str
    info: int
    section: int
    value: int
    size: int


@dataclass
class Section:
    """A section of the object; ``address`` is set by the layout of the library."""

    kind: int
    flags: int
    content: bytes
    size: int
    align: int
    address: int = 0
    relocations: list[tuple[int, int, int, int]] = field(default_factory=list)  # offset, kind, symbol, addend


def read(data: bytes) -> tuple[dict[int, Section], list[Symbol]]:
    """The sections of an object that are part of the program, by number, and its symbols."""
    header = struct.unpack_from(HEADER, data)
    if header[0][:6] != b"\x7fELF\x02\x01" or header[1:3] != (1, 62):
        raise ValueError("no relocatable object for x86-64")
    rows = [struct.unpack_from(SECTION, data, header[6] + k * header[11]) for k in range(header[12])]
    names = rows[header[13]]
    sections: dict[int, Section] = {}
    symbols: list[Symbol] = []
    for number, (name, kind, flags, _, offset, size, link, _, align, _) in enumerate(rows):
        if kind == SYMTAB:
            for at_symbol in range(offset, offset + size, 24):
                at, info, _, section, value, length = struct.unpack_from(SYMBOL, data, at_symbol)
                symbols.append(Symbol(_text(data, rows[link][4] + at), info, section, value, length))
        elif flags & ALLOC and not _text(data, names[4] + name).startswith((".eh_frame", ".note")):
            content = b"" if kind == NOBITS else data[offset : offset + size]
            sections[number] = Section(kind, flags, content, size, max(1, align))
    for _, kind, _, _, offset, size, _, target, _, _ in rows:
        if kind == RELA and target in sections:
            for at, info, addend in struct.iter_unpack(RELOCATION, data[offset : offset + size]):
                sections[target].relocations.append((at, info & 0xFFFFFFFF, info >> 32, addend))
    return sections, symbols


def _text(data: bytes, start: int) -> str:
    return data[start : data.index(b"\0", start)].decode()


def link(data: bytes) -> bytes:
    """The shared library of an object.

    Raises:
        ValueError: naming what of the object cannot be linked.
    """
    sections, symbols = read(data)
    shown = [k for k, s in enumerate(symbols) if s.info >> 4 != LOCAL and s.name]
    row = {k: n for n, k in enumerate(shown, start=1)}
    used = [r for section in sections.values() for r in section.relocations]
    through_table = {r[2] for r in used if r[1] in (R_GOTPCREL, R_GOTPCRELX, R_REX_GOTPCRELX)}
    called = {r[2] for r in used if r[1] in (R_PC32, R_PLT32) and symbols[r[2]].section == UNDEFINED}
    slots = {k: n for n, k in enumerate(sorted(through_table | called))}
    absolute = sum(r[1] == R_64 for r in used)

    # What only is read and run comes first, then, on pages of its own, what is written.
    texts = b"\0" + b"".join(symbols[k].name.encode() + b"\0" for k in shown)
    image = bytearray(64 + 4 * 56)

    def allocate(size: int, align: int = 8) -> int:
        image.extend(b"\0" * (-len(image) % align))
        start = len(image)
        image.extend(b"\0" * size)
        return start

    table = allocate(4 * (3 + len(row) + 1))
    listed = allocate(24 * (len(row) + 1))
    strings = allocate(len(texts))
    rela = allocate(24 * (len(slots) + absolute))
    stubs = allocate(6 * len(called), 16)
    for section in sections.values():
        if not section.flags & WRITE:
            section.address = allocate(section.size, section.align)
    read_bytes = len(image)
    written = allocate(0, PAGE)
    got = allocate(8 * len(slots))
    dynamic = allocate(16 * 9)
    for section in sections.values():
        if section.flags & WRITE:
            section.address = allocate(section.size, section.align)
    commons = {}
    for k, symbol in enumerate(symbols):
        if symbol.section == COMMON:
            commons[k] = allocate(symbol.size, max(1, symbol.value))
    stub_of = {k: stubs + 6 * n for n, k in enumerate(sorted(called))}

    def address(k: int) -> int | None:
        """Where a symbol is; None where the process has it."""
        symbol = symbols[k]
        if symbol.section == UNDEFINED:
            return None
        if symbol.section == COMMON:
            return commons[k]
        if symbol.section == ABSOLUTE or symbol.section not in sections:
            raise ValueError(f"symbol {symbol.name or k} is in no part of the program")
        return sections[symbol.section].address + symbol.value

    for_loader: list[tuple[int, int, int]] = []
    for k, slot in slots.items():
        at, where = got + 8 * slot, address(k)
        for_loader.append((at, row[k] << 32 | R_GLOB_DAT, 0) if where is None else (at, R_RELATIVE, where))
    for k, at in stub_of.items():  # jmp *[rip + slot]
        struct.pack_into("<HI", image, at, 0x25FF, got + 8 * slots[k] - (at + 6))
    for section in sections.values():
        image[section.address : section.address + len(section.content)] = section.content
        for offset, kind, k, addend in section.relocations:
            at, where = section.address + offset, address(k)
            if kind == R_64:
                if not section.flags & WRITE:
                    raise ValueError("an absolute address among what is only read")
                info, value = (row[k] << 32 | R_64, addend) if where is None else (R_RELATIVE, where + addend)
                for_loader.append((at, info, value))
            elif kind in (R_GOTPCREL, R_GOTPCRELX, R_REX_GOTPCRELX):
                struct.pack_into("<i", image, at, got + 8 * slots[k] + addend - at)
            elif kind in (R_PC32, R_PLT32):
                struct.pack_into("<i", image, at, (stub_of[k] if where is None else where) + addend - at)
            elif kind == R_PC64 and where is not None:
                struct.pack_into("<q", image, at, where + addend - at)
            else:
                raise ValueError(f"relocation {kind} of {symbols[k].name or k}")

    # One chain holds all names: a kernel's library has a handful.
    chain = [
        1,
        len(row) + 1,
        1 if row else 0,
        0,
        *(n + 1 if n < len(row) else 0 for n in range(1, len(row) + 1)),
    ]
    struct.pack_into(f"<{len(chain)}I", image, table, *chain)
    name_at = 1
    for k, n in row.items():
        symbol, where = symbols[k], address(k)
        number = UNDEFINED if where is None else 1
        struct.pack_into(
            SYMBOL, image, listed + 24 * n, name_at, symbol.info, 0, number, where or 0, symbol.size
        )
        name_at += len(symbol.name.encode()) + 1
    image[strings : strings + len(texts)] = texts
    for n, (at, info, value) in enumerate(for_loader):
        struct.pack_into(RELOCATION, image, rela + 24 * n, at, info, value)
    words = [(4, table), (6, listed), (5, strings), (10, len(texts)), (11, 24)]
    words += [(7, rela), (8, 24 * len(for_loader)), (9, 24)] if for_loader else []
    for n, word in enumerate(words):
        struct.pack_into("<qQ", image, dynamic + 16 * n, *word)
    segments = (
        (LOAD, 5, 0, 0, 0, read_bytes, read_bytes, PAGE),
        (LOAD, 6, written, written, written, len(image) - written, len(image) - written, PAGE),
        (DYNAMIC, 6, dynamic, dynamic, dynamic, 16 * 9, 16 * 9, 8),
        (GNU_STACK, 6, 0, 0, 0, 0, 0, 16),
    )
    struct.pack_into(
        HEADER, image, 0, b"\x7fELF\x02\x01\x01", 3, 62, 1, 0, 64, 0, 0, 64, 56, len(segments), 64, 0, 0
    )
    for n, segment in enumerate(segments):
        struct.pack_into(SEGMENT, image, 64 + 56 * n, *segment)
    return bytes(image)


def main(words: list[str]) -> int:
    """Link by the command line's arguments; 1 and a line on stderr where that is not possible."""
    output, objects, ahead = "", [], iter(words)
    for word in ahead:
        if word == "-o":
            output = next(ahead, "")
        elif word in ("-m", "-z"):
            next(ahead, "")
        elif not word.startswith("-"):
            objects.append(word)
    try:
        if not output or len(objects) != 1:
            raise ValueError("one object and -o are needed")
        Path(output).write_bytes(link(Path(objects[0]).read_bytes()))
    except (OSError, ValueError, IndexError, struct.error) as error:
        sys.stderr.write(f"Bentray's linker: {error}; install the system's (binutils, gcc)\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
