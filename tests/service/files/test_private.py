"""File modes: stored files are private to the service's user; older folders are closed at start."""

import os
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.files.data_folder import Files
from bentray_service.files.disk import close_to_others, private_files


@pytest.fixture(autouse=True)
def usual_umask() -> Iterator[None]:
    before = os.umask(0o022)
    yield
    os.umask(before)


def modes(root: Path) -> dict[str, int]:
    """What is in a folder, itself as ``.``, and its mode."""
    paths = [root, *root.rglob("*")]
    return {str(path.relative_to(root)): stat.S_IMODE(path.lstat().st_mode) for path in paths}


def test_everything_that_a_service_writes_is_for_its_user_alone(
    http,
    uploaded: Callable[..., str],
    submitted: Callable[..., dict[str, Any]],
    until: Callable[..., dict[str, Any]],
    work: Any,
    tmp_path: Path,
) -> None:
    work.hold.clear()
    job = submitted(http, uploaded(http))
    # The job is running before its folder exists; both exist once the work has begun.
    assert work.begun.wait(240.0)
    during = modes(tmp_path / "data")
    assert any("work/job-" in name for name in during), "where checkpoints are"
    assert [name for name, mode in during.items() if mode & 0o077] == []
    work.hold.set()
    volume = until(http, job["id"])["volume"]
    assert http.get(f"/v1/volumes/{volume}/data", params={"format": "npy"}).status_code == 200
    http.post("/v1/uploads", headers={"Tus-Resumable": "1.0.0", "Upload-Length": "10"})
    np.save(tmp_path / "glass.npy", np.ones((4, 4, 4), np.float32))
    octets = {"Content-Type": "application/octet-stream"}
    http.post("/v1/volumes", content=(tmp_path / "glass.npy").read_bytes(), headers=octets)
    found = modes(tmp_path / "data")
    assert [name for name, mode in found.items() if mode & 0o077] == []
    for part in ("bentray.sqlite", "service.lock", "audit/", "datasets/ds-", "volumes/vol-", "exports/vol-"):
        assert any(part in name for name in found), part
    assert found["."] == 0o700


def test_after_the_service_files_are_made_as_before(start: Callable[..., Any], tmp_path: Path) -> None:
    with private_files():
        (tmp_path / "within").touch()
    (tmp_path / "after").touch()
    assert (modes(tmp_path)["within"], modes(tmp_path)["after"]) == (0o600, 0o644)


def test_a_folder_of_an_older_version_is_closed_with_all_that_is_in_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    root, beside = tmp_path / "data", tmp_path / "beside"
    (root / "tenants" / "local").mkdir(parents=True)
    for path in (root / "bentray.sqlite", root / "tenants" / "local" / "run", beside):
        path.touch()
    (root / "tenants" / "local" / "run").chmod(0o755)
    (root / "link").symlink_to(beside)
    Files(root).prepare()
    assert [name for name, mode in modes(root).items() if mode & 0o077] == ["link"]
    assert stat.S_IMODE((root / "tenants" / "local" / "run").stat().st_mode) == 0o700
    assert stat.S_IMODE(beside.stat().st_mode) == 0o644
    assert "had mode 0755" in caplog.text
    caplog.clear()
    Files(root).prepare()
    assert caplog.text == ""


def test_a_folder_that_cannot_be_closed_is_rejected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As one of another user, or of a file system without modes."""
    tmp_path.chmod(0o755)
    monkeypatch.setattr(Path, "chmod", lambda path, mode: None)
    with pytest.raises(InvalidInput, match=r"mode 0755\).*a folder whose permissions this user can change"):
        close_to_others(tmp_path)
