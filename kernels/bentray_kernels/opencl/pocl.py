"""Workarounds for PoCL from pip: a processor name that its compiler accepts, and a linker if there is none.

The newest PoCL of the Python index, 3.0-rc2 of 2022, asks its LLVM 14 for the processor's name, but chooses
its library of built-in functions by the processor's features. Where the two disagree it fails. A processor
newer than LLVM 14 (AMD family 26) is called ``generic``, which its own compiler refuses. One whose name
promises less than its features (AMD family 25 with AVX-512) gets functions compiled for wider registers than
their callers: vectors of 8 doubles end the process, those of 16 are wrong. Later releases take the name from
the chosen library. The same is done here for that one build, in the record that it keeps of its device.

PoCL also starts the system's linker once a kernel, with the libraries of a C compiler. A system without them
(a slim container) gets the linker in ``link/``, by the variable in which PoCL's compiler looks for programs.
"""

import ctypes
import os
import shutil
import sys
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


# What the system needs to link a kernel beside the program ``ld``, as patterns of files.
SYSTEM_LIBRARIES = (("usr/lib*/gcc/*/*/libgcc.a",), ("usr/lib*/libc.so", "usr/lib/*/libc.so"))

# Where the compiler looks for ``ld`` first, and which Python our ``ld`` starts.
PROGRAMS, PYTHON = "COMPILER_PATH", "BENTRAY_PYTHON"


def prepare(handle: Any) -> None:
    """Prepare a device of that build for its first program; other devices are not changed."""
    if Path(library_of(handle)).name == BUILD:
        _name_processor(handle)
        if not system_links():
            _provide_linker()


def system_links(root: Path = Path("/")) -> bool:
    """Whether the system has a linker and the libraries that PoCL links."""
    matches = (any(any(root.glob(pattern)) for pattern in patterns) for patterns in SYSTEM_LIBRARIES)
    return shutil.which("ld") is not None and all(matches)


def _provide_linker() -> None:
    ours = str(Path(__file__).parent / "link")
    folders = [folder for folder in os.environ.get(PROGRAMS, "").split(os.pathsep) if folder]
    if ours not in folders:
        # A setting of the user has priority.
        os.environ[PROGRAMS] = os.pathsep.join([*folders, ours])
        os.environ[PYTHON] = sys.executable


def _name_processor(handle: Any) -> None:
    name = processor_name(processor())
    field = ctypes.c_char_p.from_address(handle.int_ptr + NAME_OFFSET)
    # The version string, already built, ends with the original name.
    own_name = (field.value or b"").decode()
    if name in (None, own_name) or not own_name or not handle.version.strip().endswith(f"-{own_name}"):
        return
    copy = ctypes.CDLL(None).strdup
    copy.restype = ctypes.c_void_p
    # A separate copy, since PoCL frees it.
    ctypes.c_void_p.from_address(handle.int_ptr + NAME_OFFSET).value = copy(str(name).encode())


def processor_name(features: Collection[str]) -> str | None:
    """The processor that PoCL's library for these features was compiled for; None where it has none."""
    return next((name for name, needed in reversed(BUILT_FOR) if set(needed) <= set(features)), None)
