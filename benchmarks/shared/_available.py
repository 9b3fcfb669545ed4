"""Installed peer packages, and the reasons for missing ones."""

import importlib
from collections.abc import Callable, Mapping
from typing import TypeVar

Peer = TypeVar("Peer")


def available(peers: Mapping[str, tuple[str, Callable[..., Peer]]]) -> tuple[dict[str, Peer], dict[str, str]]:
    """The peers that can be imported, and why the others cannot; ``peers`` is name to (module, adapter)."""
    modules: dict[str, Peer] = {}
    missing: dict[str, str] = {}
    for name, (module, adapt) in peers.items():
        try:
            modules[name] = adapt(importlib.import_module(module))
        except ImportError as error:
            missing[name] = f"{name} is not installed ({error})"
    return modules, missing
