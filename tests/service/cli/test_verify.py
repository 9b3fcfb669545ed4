"""`bentray verify`: names damaged files, adds missing checksums, removes orphans."""

import json
from contextlib import closing
from pathlib import Path

import pytest

from bentray_service.files.checked_store import CheckedStore
from bentray_service.files.data_folder import Files
from bentray_service.files.store import Store
from bentray_service.rows.checksums import Checksums
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL, new_id
from bentray_service.rows.stored_tables import Datasets

from ..rows.conftest import SUMMARY
from .conftest import Run


@pytest.fixture
def stored(tmp_path: Path) -> tuple[Path, Path, Path]:
    """A file with a checksum, one from before there were any, and one without a row."""
    with closing(open_database(f"sqlite:///{tmp_path / 'bentray.sqlite'}")) as database:
        files = Files(tmp_path, CheckedStore(Store(), tmp_path, Checksums(database)))
        files.prepare()
        paths = [files.of(LOCAL).dataset(new_id("dataset")) for _ in range(3)]
        for path in paths:
            path.write_bytes(b"what a scan holds")
        for path in paths[:2]:
            Datasets(database).add(LOCAL, path.stem, size=1, sha256="", summary=SUMMARY)
        files.store.publish(paths[0])
    return paths[0], paths[1], paths[2]


def test_sound_first_seen_and_orphan(bentray: Run, tmp_path: Path, stored: tuple[Path, Path, Path]) -> None:
    found = []
    for _ in range(2):
        result = bentray("verify", "--data", tmp_path, "--json")
        found.append(json.loads(result.stdout)["counts"])
    assert found == [{"sound": 1, "first seen": 1, "orphan": 1}, {"sound": 2, "orphan": 1}]
    result = bentray("verify", "--data", tmp_path, "--remove-orphans")
    assert [path.exists() for path in stored] == [True, True, False]


@pytest.mark.parametrize("spoil", ["flip", "cut", "missing"])
def test_damage_is_named_until_it_is_restored(
    bentray: Run, tmp_path: Path, stored: tuple[Path, Path, Path], spoil: str
) -> None:
    path = stored[0]
    content = path.read_bytes()
    if spoil == "missing":
        path.unlink()
    else:
        path.write_bytes(content[:-1] + b"?" if spoil == "flip" else content[:3])
    result = bentray("verify", "--data", tmp_path, code=1)
    assert result.stderr.endswith("bentray: 1 of 3 stored items are damaged\n")
    assert f"damaged: local datasets/{path.name}" in result.stdout
    path.write_bytes(content)
    bentray("verify", "--data", tmp_path)
