"""The data folder as a store, plain and checked: damaged files are rejected by name or replaced."""

import os

import pytest
from sqlalchemy import insert

from bentray_service.errors import Damaged, Deleted
from bentray_service.files.bucket_store import open_store
from bentray_service.files.checked_store import CheckedStore
from bentray_service.files.data_folder import Files
from bentray_service.files.store import Store
from bentray_service.rows.checksums import Checksums
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL, new_id
from bentray_service.rows.tables import UploadedVolumeRow

from .store_suite import StoreSuite

CONTENT = bytes(range(256)) * 100


@pytest.fixture
def rows(tmp_path):
    database = open_database(f"sqlite:///{tmp_path / 'db.sqlite'}")
    yield Checksums(database)
    database.close()


@pytest.fixture
def opened(tmp_path, rows):
    """Open the data folder as a new process does."""

    def go():
        files = Files(tmp_path / "data", CheckedStore(Store(), tmp_path / "data", rows))
        files.prepare()
        return files

    return go


def stored(files):
    path = files.of(LOCAL).dataset(new_id("dataset"))
    path.write_bytes(CONTENT)
    files.store.publish(path)
    return path


def flip(path, *, quietly=True):
    """One bit; ``quietly``: as a disk does it, without a new age."""
    before = path.stat()
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    if quietly:
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


class TestCheckedLocalStore(StoreSuite):
    @pytest.fixture
    def files(self, opened):
        return opened()

    @pytest.fixture
    def elsewhere(self, opened):
        return opened()


def test_a_flipped_bit_is_found_by_the_next_process(opened, rows, caplog):
    path = stored(opened())
    flip(path)
    store = opened().store
    for _ in range(2):
        with pytest.raises(Damaged, match=f"{path.stem}, different content"):
            store.fetch(path)
    assert rows.get(LOCAL, path.stem).damaged is not None
    assert len(caplog.records) == 1, "said once"


def test_a_file_that_another_program_writes_to_is_found_at_once(opened):
    files = opened()
    path = stored(files)
    assert files.store.fetch(path) == path
    flip(path, quietly=False)
    with pytest.raises(Damaged):
        files.store.fetch(path)


@pytest.mark.parametrize("left", [0, 1, len(CONTENT) - 1])
def test_a_cut_file(opened, left):
    path = stored(opened())
    os.truncate(path, left)
    with pytest.raises(Damaged, match=f"{left} bytes instead of 25600"):
        opened().store.fetch(path)


def test_a_missing_file_is_damage_and_a_deleted_one_is_not(opened, rows):
    files = opened()
    path = stored(files)
    path.unlink()
    with pytest.raises(Damaged, match="missing"):
        files.store.fetch(path)
    with pytest.raises(Deleted):
        files.store.fetch(files.of(LOCAL).dataset(new_id("dataset")))


def test_a_folder(opened):
    files = opened()
    folder = files.of(LOCAL).field("field-" + "0" * 20)
    folder.mkdir()
    for name in ("layout.json", "outer.npy"):
        (folder / name).write_bytes(CONTENT)
    files.store.publish(folder)
    assert opened().store.fetch(folder) == folder
    flip(folder / "outer.npy")
    with pytest.raises(Damaged):
        opened().store.fetch(folder)


def test_it_is_read_once_a_process(opened, monkeypatch):
    files, read = opened(), []
    path = stored(files)
    from bentray_service.files import checked_store

    digest = checked_store.digest_of
    monkeypatch.setattr(checked_store, "digest_of", lambda path: read.append(path) or digest(path))
    for _ in range(3):
        files.store.fetch(path)
    assert read == [path]


def test_a_restored_file_is_taken_again(opened, rows):
    files = opened()
    path = stored(files)
    flip(path)
    with pytest.raises(Damaged):
        opened().store.fetch(path)
    path.write_bytes(CONTENT)
    assert files.store.fetch(path).read_bytes() == CONTENT
    assert rows.get(LOCAL, path.stem).damaged is None


def test_damage_found_by_a_scrub_is_not_served(opened, rows):
    files = opened()
    path = stored(files)
    files.store.fetch(path)
    flip(path)
    rows.damaged(LOCAL, path.stem, 1.0)
    with pytest.raises(Damaged):
        files.store.fetch(path)


def test_a_file_of_an_older_version_is_taken_as_it_is_and_kept_so(opened, rows, tmp_path):
    path = opened().of(LOCAL).volume(new_id("volume"))
    path.write_bytes(CONTENT)
    told = {"title": "", "shape": [], "spacing_m": [], "origin_m": [], "value_range": []}
    own = {"tenant": LOCAL, "id": path.stem, "created": 0.0, "bytes": len(CONTENT), "sha256": ""}
    database = open_database(f"sqlite:///{tmp_path / 'db.sqlite'}")
    with database.write() as connection:
        connection.execute(insert(UploadedVolumeRow).values(**own, **told))
    database.close()
    assert opened().store.fetch(path) == path
    row = rows.get(LOCAL, path.stem)
    assert (row.as_written, row.bytes, row.path) == (False, len(CONTENT), f"volumes/{path.name}")
    flip(path)
    with pytest.raises(Damaged):
        opened().store.fetch(path)


def test_the_work_of_a_job_changes_freely(opened, rows):
    files = opened()
    folder = files.of(LOCAL).work(new_id("job"))
    assert files.store.fetch(folder) == folder
    (folder / "part-0.npz").write_bytes(CONTENT)
    assert opened().store.fetch(folder) == folder
    assert rows.all() == []


def test_deleted_files_get_no_new_checksum(opened, rows):
    # The rows are gone, the file is not yet.
    path = stored(opened())
    rows.delete(LOCAL, [path.stem])
    with pytest.raises(Deleted):
        opened().store.fetch(path)
    assert rows.all() == []


def test_a_bucket_has_another_copy(tmp_path, rows, bucket_url):
    database = open_database(f"sqlite:///{tmp_path / 'db.sqlite'}")
    root = tmp_path / "data"
    store = CheckedStore(open_store(bucket_url, root, database, 2**30), root, rows)
    files = Files(root, store)
    files.prepare()
    path = stored(files)
    flip(path)
    assert store.fetch(path).read_bytes() == CONTENT
    assert rows.get(LOCAL, path.stem).damaged is None
    database.close()


class TestStore(StoreSuite):
    @pytest.fixture
    def files(self, tmp_path):
        files = Files(tmp_path)
        files.prepare()
        return files

    @pytest.fixture
    def elsewhere(self, files):
        return files
