"""Digests for the compile cache: of a kernel's module and of all modules of the package that it imports."""

import ast
import hashlib
import json
import os
import re
import sys
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

from .cache_folder import VARIABLE, cache_folder

ROOT = Path(__file__).parents[1]

# ``from ..rays.descent import STEP, trace_ray``, also over several lines in brackets.
_IMPORT = re.compile(r"^[ \t]*from (\.+)([\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)

# Digests of syntax trees by digests of their text: parsing the whole package takes a second.
MEMORY = f"syntax-{sys.version_info.major}.{sys.version_info.minor}.json"
# Most files remembered, from all checkouts and versions.
MAX_ENTRIES = 10_000


@cache
def digest(module: str) -> str:
    """Hex digest for a module of this package, as ``bentray_kernels.rays.descent``.

    Edits elsewhere in the package, and of comments and docstrings, do not change it. A module
    outside the package, as of a benchmark, may use all of the package and of its own folder.
    """
    package, *parts = module.split(".")
    if package == ROOT.name:
        reached = _reached(*_located(ROOT, parts))
    else:
        reached = {*ROOT.rglob("*.py"), *_folder(module).glob("*.py")}
    found, memory = hashlib.sha256(), _memory()
    known = len(memory)
    for path in sorted(reached):
        found.update(_syntax(path, memory).encode())
    if len(memory) > known:
        _keep(memory)
    return found.hexdigest()


def _folder(module: str) -> Path:
    file = getattr(sys.modules.get(module), "__file__", None)
    return Path(file).parent if file else ROOT


def _syntax(path: Path, memory: dict[str, str]) -> str:
    """Hex digest of the syntax tree of a file, without comments, docstrings and layout."""
    text = path.read_bytes()
    key = hashlib.sha256(text).hexdigest()
    if key not in memory:
        memory[key] = hashlib.sha256(_without_docstrings(text).encode()).hexdigest()
    return memory[key]


def _without_docstrings(text: bytes) -> str:
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                node.body = node.body[1:]
    return ast.dump(tree)


def _memory_file() -> Path | None:
    """In the folder of numba's cache if one is configured, as in the image; else in the user's cache."""
    folder = os.environ.get(VARIABLE) or cache_folder()
    return Path(folder, MEMORY) if folder else None


@cache
def _memory() -> dict[str, str]:
    file = _memory_file()
    with suppress(OSError, ValueError):
        found = json.loads(file.read_text(encoding="ascii")) if file else None
        if isinstance(found, dict):
            return {str(key): str(value) for key, value in found.items()}
    return {}


def _keep(memory: dict[str, str]) -> None:
    """Write the file atomically; entries that another process adds meanwhile are parsed again."""
    file = _memory_file()
    if file is None:
        return
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        newest = dict(list(memory.items())[-MAX_ENTRIES:])
        with tempfile.NamedTemporaryFile("w", dir=file.parent, delete=False, encoding="ascii") as partial:
            json.dump(newest, partial)
        Path(partial.name).replace(file)


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
    """The modules of this package that a module imports."""
    found: list[Path] = []
    for dots, name, words in _IMPORT.findall(path.read_text(encoding="utf-8")):
        folder = path.parents[len(dots) - 1]
        parts = name.split(".") if name else []
        found += _located(folder, parts)
        # ``from . import huber`` imports a module.
        for word in re.findall(r"\w+", words):
            found += _located(folder, [*parts, word])
    return tuple(found)


def _located(folder: Path, parts: list[str]) -> list[Path]:
    """The file of a module or package below a folder; none where the name is something else."""
    base = folder.joinpath(*parts)
    return [path for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file()][:1]
