"""Wheel and sdist of this tree, built once for all tests of packages."""

import os
import sys
from pathlib import Path

import pytest

from .programs import ROOT, run

RELEASED = {"SOURCE_DATE_EPOCH": "1767225600"}


@pytest.fixture(scope="session")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of both, with a documentation of two files."""
    folder, pages = tmp_path_factory.mktemp("dist"), tmp_path_factory.mktemp("pages")
    (pages / "_static").mkdir()
    (pages / "_static" / "pages.css").write_text("p { color: black; }")
    (pages / "index.html").write_text(f"<!doctype html><title>Bentray</title><p>{'text ' * 300}</p>")
    variables = {**os.environ, **RELEASED, "BENTRAY_DOCUMENTATION": str(pages)}
    build = (sys.executable, "-m", "hatchling", "build", "-d", str(folder), "-t", "sdist", "-t", "wheel")
    run(*build, folder=ROOT, variables=variables)
    return folder
