"""What earlier versions left behind, killed at work."""

import json
import tarfile
from pathlib import Path

import pytest

ARCHIVES = sorted(Path(__file__).parent.glob("version-*.tar.xz"))


@pytest.fixture(params=ARCHIVES, ids=lambda path: path.name.removesuffix(".tar.xz"))
def left(request, tmp_path):
    """What an earlier version answered; its data folder is ``tmp_path / "data"``."""
    with tarfile.open(request.param) as archive:
        archive.extractall(tmp_path, filter="data")
    return json.loads((tmp_path / "expected.json").read_text())
