"""A sample of faults, spread evenly over the modules, and how a fault is stored."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

from .nearest_tests import PACKAGE, modules
from .planted_faults import Fault, planted_faults


def sample(root: Path, count: int, seed: int) -> list[tuple[str, Fault]]:
    """Faults in turn from all modules, in random order; of each module the kinds in turn.

    The first faults of a longer sample are those of a shorter one.
    """
    queues = {}
    for module in modules(root):
        faults = planted_faults((root / PACKAGE / module).read_text(encoding="utf-8"))
        queues[module] = _mixed(faults, random.Random(f"{seed} {module}"))
    # An order that no new module changes.
    order = sorted(queues, key=lambda module: random.Random(f"{seed} order {module}").random())
    found: list[tuple[str, Fault]] = []
    while len(found) < count and any(queues.values()):
        for module in order:
            if queues[module] and len(found) < count:
                found.append((module, queues[module].pop()))
    return found


def _mixed(faults: list[Fault], chosen: random.Random) -> list[Fault]:
    """In random order, the kinds in turn; to be taken from the end."""
    kinds: dict[str, list[Fault]] = {}
    for fault in chosen.sample(faults, len(faults)):
        kinds.setdefault(fault.kind, []).append(fault)
    mixed = []
    while kinds:
        for kind in chosen.sample(sorted(kinds), len(kinds)):
            mixed.append(kinds[kind].pop())
            if not kinds[kind]:
                del kinds[kind]
    return mixed[::-1]


def entry(module: str, fault: Fault) -> dict[str, Any]:
    """A fault as it is stored."""
    return {
        "module": module,
        "function": fault.function,
        "line": fault.line,
        "kind": fault.kind,
        "before": fault.before,
        "after": fault.after,
    }


def key(one: dict[str, Any]) -> str:
    """What a fault keeps when lines above it change."""
    return f"{one['module']} {one['function']}: {one['before']} -> {one['after']}"
