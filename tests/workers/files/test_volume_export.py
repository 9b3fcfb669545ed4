"""A volume deleted during its export is a client error, not a failure of the service."""

from pathlib import Path

import numpy as np
import pytest

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Reconstruction
from bentray_workers.files import volume_export
from bentray_workers.files.export import npy_writing
from bentray_workers.files.export.content import Content
from bentray_workers.files.volume import Volume, write_volume
from bentray_workers.files.volume_export import export_volume


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    write_volume(tmp_path / "volume.h5", Volume(np.zeros((3, 4, 5), np.float32), (1e-3,) * 3, (0.0,) * 3, ""))
    return tmp_path / "volume.h5"


def test_a_volume_deleted_during_its_export_is_named(
    stored: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write(target: Path, content: Content) -> None:
        with npy_writing.atomic_replace(target) as partial:
            partial.write_bytes(b"begun")
            for path in tmp_path.iterdir():
                path.unlink()

    monkeypatch.setattr(npy_writing, "write", write)
    with pytest.raises(InvalidInput, match="volume: found one that was deleted during its export"):
        export_volume(stored, target=tmp_path / "volume.npy", name="npy")
    assert list(tmp_path.iterdir()) == []
    missing = tmp_path / "absent" / "volume.npy"
    write_volume(stored, Volume(np.zeros((3, 4, 5), np.float32), (1e-3,) * 3, (0.0,) * 3, ""))
    with pytest.raises(FileNotFoundError):
        export_volume(stored, target=missing, name="npy")


def test_a_volume_deleted_after_it_was_read_is_named(
    stored: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = volume_export.read_image

    def read_and_delete(path: Path) -> Reconstruction | Volume:
        result = read(path)
        path.unlink()
        return result

    monkeypatch.setattr(volume_export, "read_image", read_and_delete)
    with pytest.raises(InvalidInput, match="volume: found one that was deleted during its export"):
        export_volume(stored, target=tmp_path / "volume.npy", name="npy")
