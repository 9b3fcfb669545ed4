"""Every message and page that tells how to install something names what pyproject.toml has."""

import ast
import re
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path

from .test_repository import normal

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = {
    extra: {normal(one) for one in wanted} for extra, wanted in PROJECT["optional-dependencies"].items()
}
FOLDERS = ("kernels", "workers", "service", "docs", "deploy", "benchmarks")
PAGES = ("README.md", "CONTRIBUTING.md", "Makefile", "docker-compose.yml")
# The functions that make a message of a library and an extra.
OPTIONAL = ("import_optional", "_library")


def texts() -> Iterator[tuple[str, str]]:
    """Name and content of every file that a person may read a message of."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", *FOLDERS, *PAGES], cwd=ROOT, capture_output=True, check=True
    )
    for name in listed.stdout.decode().split("\0"):
        path = ROOT / name
        if path.is_file() and path.suffix in (".py", ".md", ".js", ".html", ".toml", ".yml", ".sh", ""):
            yield name, path.read_text()


def optional_calls() -> Iterator[tuple[str, str, str]]:
    """File, library and extra of every import of an optional library."""
    for name, text in texts():
        if not name.endswith(".py"):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in OPTIONAL:
                library, extra = (one.value for one in node.args[:2] if isinstance(one, ast.Constant))
                yield name, library, extra


def test_every_extra_that_is_named_exists() -> None:
    named = [
        (name, extra)
        for name, text in texts()
        for extras in re.findall(r"(?:bentray|'\.)\[([a-z0-9, -]+)\]", text)
        for extra in re.split(r", ?", extras)
    ]
    assert {"xarray", "intel-opencl", "bench", "export"} <= {extra for _, extra in named}
    assert [(name, extra) for name, extra in named if extra not in EXTRAS] == []


def test_every_optional_library_is_in_its_extra() -> None:
    listed = list(optional_calls())
    assert {"xarray", "zarr", "highdicom", "dask_jobqueue"} <= {library for _, library, _ in listed}
    for name, library, extra in listed:
        assert normal(library.partition(".")[0]) in EXTRAS[extra], (name, library, extra)


def test_every_package_that_is_named_is_known() -> None:
    known = set().union(*EXTRAS.values()) | {normal(one) for one in PROJECT["dependencies"]}
    # Tools and peers that no extra can hold; CONTRIBUTING.md and Makefile say why.
    known |= {"uv", "pyfmm-kit", "k-wave-python", "py-rattler-build"}
    for name, text in texts():
        for words in re.findall(r"pip install ([^\n`\";&|]+)", text):
            plain = [word for word in words.split() if re.fullmatch(r"[a-z][a-z0-9-]+", word)]
            assert set(plain) <= known, (name, words)
