"""The shared library of an OpenCL driver, and the Python package that contains it."""

import ctypes
import os
from collections.abc import Iterator
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

# Packages of the Python index that contain a driver: PoCL, and Intel's runtime for processors.
PACKAGES = ("pocl-binary-distribution", "intel-opencl-rt")


class _SymbolInfo(ctypes.Structure):
    """``Dl_info`` of <dlfcn.h>."""

    _fields_ = (
        ("file", ctypes.c_char_p),
        ("base", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
    )


def library_of(handle: Any) -> str:
    """Path of the shared library that a ``pyopencl.Device`` belongs to; empty if unknown.

    Objects of a driver begin with a pointer to its table of functions (cl_khr_icd); the dynamic linker gives
    the file from which the first of these functions was loaded.
    """
    if not handle.int_ptr:
        return ""
    table = ctypes.c_void_p.from_address(handle.int_ptr).value
    function = ctypes.c_void_p.from_address(table).value if table else None
    info = _SymbolInfo()
    try:
        located = function and ctypes.CDLL(None).dladdr(ctypes.c_void_p(function), ctypes.byref(info))
    except (OSError, AttributeError):  # a system without dladdr
        return ""
    return os.fsdecode(info.file) if located and info.file else ""


@cache
def package_of(library: str) -> str:
    """Name and version of the Python package that contains a library; empty without one."""
    if library:
        for package in PACKAGES:
            files = files_of(package, Path(library).name)
            if any(file.resolve() == Path(library).resolve() for file in files):
                return f"{package} {metadata.version(package)}"
    return ""


def files_of(package: str, name: str) -> Iterator[Path]:
    """The files of that name in an installed package; none if it is not installed."""
    try:
        listed = metadata.files(package) or []
    except metadata.PackageNotFoundError:
        return
    for file in listed:
        if file.name == name:
            yield Path(os.path.normpath(file.locate()))
