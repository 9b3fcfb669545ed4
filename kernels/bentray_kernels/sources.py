"""What a module's results hang on: a digest of its source and of every module that it imports, in turn."""

from __future__ import annotations

import hashlib
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent

# ``from ..rays.descent import STEP, walk``, also over several lines in brackets.
_IMPORT = re.compile(r"^[ \t]*from (\.+)([\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


@cache
def digest(module: str) -> str:
    """Hex digest for a module of this package, as ``bentray_kernels.rays.descent``.

    An edit elsewhere in the package leaves it as it is. A module of somebody else may use all of the package.
    """
    package, *parts = module.split(".")
    reached = _reached(*_located(ROOT, parts)) if package == ROOT.name else set(ROOT.rglob("*.py"))
    found = hashlib.sha256()
    for path in sorted(reached):
        found.update(path.read_bytes())
    return found.hexdigest()


def _reached(*start: Path) -> set[Path]:
    seen: set[Path] = set()
    ahead = list(start)
    while ahead:
        path = ahead.pop()
        if path not in seen:
            seen.add(path)
            ahead += _imported(path)
    return seen


@cache
def _imported(path: Path) -> tuple[Path, ...]:
    """The modules that one names in its imports from this package."""
    found: list[Path] = []
    for dots, name, words in _IMPORT.findall(path.read_text(encoding="utf-8")):
        folder = path.parents[len(dots) - 1]
        parts = name.split(".") if name else []
        found += _located(folder, parts)
        # ``from . import huber`` names a module.
        for word in re.findall(r"\w+", words):
            found += _located(folder, [*parts, word])
    return tuple(found)


def _located(folder: Path, parts: list[str]) -> list[Path]:
    """The file of a module or package below a folder; none where the name is something else."""
    base = folder.joinpath(*parts)
    return [path for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file()][:1]
