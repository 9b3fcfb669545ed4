"""Data of earlier versions, killed at work."""

import json
import tarfile
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent
VERSIONS = sorted(path.name.removesuffix(".tar.xz") for path in FOLDER.glob("version-*.tar.xz"))


@pytest.fixture(params=VERSIONS)
def left(request, tmp_path):
    """Answers of an earlier version; its data folder is ``tmp_path / "data"``."""
    with tarfile.open(FOLDER / f"{request.param}.tar.xz") as archive:
        archive.extractall(tmp_path, filter="data")
    return json.loads((tmp_path / "expected.json").read_text())
