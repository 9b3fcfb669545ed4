"""`bentray download`: scans and volumes by id, in the format of the file name; invalid input."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from .conftest import Run

SCAN, VOLUME = "ds-" + "0" * 20, "vol-" + "0" * 20


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Requests to the client, with a stand-in that writes a few bytes."""
    results: list[Any] = []

    class StandIn:
        def __init__(self, url: str, on_wait: Callable[[str], None]) -> None:
            results.append(url)

        def __enter__(self) -> StandIn:
            return self

        def __exit__(self, *_: object) -> None: ...

        def download(self, volume: str, format: str, path: Path, **how: str) -> None:  # noqa: A002
            results.append((volume, format, *how.values()))
            path.write_bytes(b"volume")

        def download_dataset(self, dataset: str, path: Path, told: Callable[[int, int], None]) -> None:
            results.append(dataset)
            path.write_bytes(b"scan")
            told(4, 4)

    monkeypatch.setattr("bentray_service.client.Client", StandIn)
    return results


def test_a_scan_and_a_volume(bentray: Run, tmp_path: Path, asked: list[Any]) -> None:
    result = bentray("download", SCAN, "-o", tmp_path / "scan.h5", "--url", "http://lab:1", "--json")
    assert json.loads(result.stdout) == {"id": SCAN, "output": str(tmp_path / "scan.h5"), "bytes": 4}
    for name in ("v.nii", "v.MHA"):
        result = bentray("download", VOLUME, "-o", tmp_path / name)
        assert result.stdout.splitlines() == [str(tmp_path / name)]
    told = [request for request in asked if not str(request).startswith("http")]
    assert (asked[0], told) == ("http://lab:1", [SCAN, (VOLUME, "nifti"), (VOLUME, "metaimage")])


def test_a_format_by_its_name(bentray: Run, tmp_path: Path, asked: list[Any]) -> None:
    for form in ("h5", "hdf5", "npy"):
        bentray("download", VOLUME, "-o", tmp_path / f"image-{form}", "--format", form)
    told = [request for request in asked if not str(request).startswith("http")]
    assert told == [(VOLUME, "hdf5"), (VOLUME, "hdf5"), (VOLUME, "npy")]
    refused = bentray("download", SCAN, "-o", tmp_path / "scan", "--format", "npy", code=2)
    assert "format: found 'npy'; accepted: one of hdf5, h5" in refused.stderr
