"""PoCL as pip brings it, told the name of a processor that its compiler knows.

The newest PoCL of the Python index, 3.0-rc2 of 2022, asks its LLVM 14 for the processor's name, but chooses
its library of built-in functions by the processor's features. Where the two disagree it fails. A processor
newer than LLVM 14 (AMD family 26) is called ``generic``, which its own compiler refuses. One whose name
promises less than its features (AMD family 25 with AVX-512) gets functions compiled for wider registers than
their callers: vectors of 8 doubles end the process, those of 16 are wrong. Later releases take the name from
the chosen library. The same is done here for that one build, in the record that it keeps of its device.
"""

from __future__ import annotations

import ctypes
from collections.abc import Collection
from pathlib import Path
from typing import Any

from .library import library_of
from .processor import processor

# The build: its file is named after a digest of its content, so that the layout of its records is known.
BUILD = "libpocl-21062cec.so"

# Bytes from the start of a device's record to the pointer to the processor's name.
NAME_OFFSET = 0x280

# The processor that each library of built-in functions was compiled for, and the features that PoCL asks of a
# processor before it takes that library; it takes the last that fits.
BUILT_FOR = (
    ("x86-64", ("sse2",)),
    ("core2", ("ssse3", "cx16")),
    ("penryn", ("sse4_1", "cx16")),
    ("sandybridge", ("avx", "cx16", "popcnt")),
    ("ivybridge", ("avx", "cx16", "popcnt", "f16c")),
    ("bdver1", ("avx", "cx16", "popcnt", "xop", "fma4")),
    ("haswell", ("avx", "avx2", "cx16", "popcnt", "abm", "f16c", "fma", "bmi1", "bmi2")),
    ("skylake-avx512", ("avx512f",)),
)


def name_processor(handle: Any) -> None:
    """Write the name into a device of that build before its first program; leave all others as they are."""
    if Path(library_of(handle)).name != BUILD:
        return
    name = processor_name(processor())
    field = ctypes.c_char_p.from_address(handle.int_ptr + NAME_OFFSET)
    # The version, made before, ends with the name that was found first.
    known = (field.value or b"").decode()
    if name in (None, known) or not known or not handle.version.strip().endswith(f"-{known}"):
        return
    copy = ctypes.CDLL(None).strdup
    copy.restype = ctypes.c_void_p
    # A copy of its own, since PoCL frees what it holds.
    ctypes.c_void_p.from_address(handle.int_ptr + NAME_OFFSET).value = copy(str(name).encode())


def processor_name(features: Collection[str]) -> str | None:
    """The processor that PoCL's library for these features was compiled for; None where it has none."""
    return next((name for name, needed in reversed(BUILT_FOR) if set(needed) <= set(features)), None)
