"""Import of libraries that only some installations have."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from bentray_kernels.errors import InvalidInput


def import_optional(library: str, extra: str, what: str) -> Any:
    """A library of an extra of the package.

    Raises:
        InvalidInput: naming the command that installs it.
    """
    try:
        return import_module(library)
    except ImportError:
        accepted = f'another format, or an installation with pip install "bentray[{extra}]"'
        raise InvalidInput("format", f"{what} without the library {library}", accepted) from None
