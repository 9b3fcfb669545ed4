"""Files without a row go at the next start, and later too, but not from a folder of another database."""

import shutil

import pytest

from bentray_service.files.data_folder import STAMP, Files
from bentray_service.files.orphans import SAFE_S, Orphans
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL, new_id
from bentray_service.rows.stored_tables import Datasets
from bentray_service.rows.uploads import Uploads

from ...clock import Clock
from ..rows.conftest import SUMMARY


@pytest.fixture
def files(tmp_path):
    found = Files(tmp_path / "data")
    found.prepare()
    return found


@pytest.fixture
def other(tmp_path):
    """Another database."""
    opened = open_database(f"sqlite:///{tmp_path / 'other.sqlite'}")
    yield opened
    opened.close()


def fill(files, database):
    """What a killed service leaves: things with rows, and of every kind one without."""
    mine = files.of(LOCAL)
    dataset = Datasets(database).add(LOCAL, new_id("dataset"), size=1, sha256="0", summary=SUMMARY).id
    upload = Uploads(database).add(LOCAL, "mesh", 9, {}, "", 60.0, 10**9).id
    kept = [mine.dataset(dataset), mine.upload(upload), mine.volume(new_id("volume")).with_suffix(".partial")]
    job = new_id("job")
    orphans = [mine.dataset(new_id("dataset")), mine.volume(new_id("volume")), mine.animation(job, "zip")]
    orphans += [
        mine.export(new_id("volume"), "npy"),
        mine.upload(new_id("upload")),
        mine.mesh(new_id("mesh")),
    ]
    for path in (*kept, *orphans):
        path.write_bytes(b"x")
    folder = mine.field("field-" + "1" * 20)
    folder.mkdir()
    (folder / "outer.npy").write_bytes(b"x")
    return kept, [*orphans, folder]


def started(files, database, clock=None):
    found = Orphans(files, database, is_store=True, clock=clock or Clock())
    found.begin()
    return found


def test_they_go_at_the_next_start(files, database):
    started(files, database)
    kept, orphans = fill(files, database)
    started(files, database)
    assert not any(path.exists() for path in orphans)
    assert all(path.exists() for path in kept)


def test_they_go_after_a_while(files, database):
    clock = Clock()
    running = started(files, database, clock)
    kept, orphans = fill(files, database)
    running.sweep(lambda: False)
    clock.now = SAFE_S - 1.0
    running.sweep(lambda: False)
    assert all(path.exists() for path in orphans), "their rows may be on the way"
    clock.now = SAFE_S
    running.sweep(lambda: False)
    assert not any(path.exists() for path in orphans)
    assert all(path.exists() for path in kept)


def test_a_folder_of_another_database_is_left_alone(files, database, other, caplog):
    started(files, other)
    _, orphans = fill(files, other)
    clock = Clock()
    running = started(files, database, clock)
    for clock.now in (0.0, 2 * SAFE_S, 4 * SAFE_S):
        running.sweep(lambda: False)
    assert all(path.exists() for path in orphans)
    assert "9 files" in caplog.text
    assert "another database" in caplog.text
    started(files, other)
    assert not any(path.exists() for path in orphans)


def test_a_database_of_before_the_files_leaves_them(files, tmp_path, caplog):
    address = tmp_path / "db.sqlite"
    database = open_database(f"sqlite:///{address}")
    started(files, database)
    database.close()
    shutil.copy(address, tmp_path / "dump.sqlite")
    database = open_database(f"sqlite:///{address}")
    started(files, database)
    kept, _ = fill(files, database)
    database.close()
    restored = open_database(f"sqlite:///{tmp_path / 'dump.sqlite'}")
    started(files, restored)
    restored.close()
    assert all(path.exists() for path in kept)
    assert "a later state" in caplog.text


def test_the_first_start_removes_nothing(files, database):
    kept, orphans = fill(files, database)
    started(files, database)
    assert all(path.exists() for path in (*kept, *orphans))
    assert not (files.root / STAMP).exists()


def test_cache_cleanup_removes_only_derived_files(files, database):
    started(files, database)
    _, orphans = fill(files, database)
    Orphans(files, database, is_store=False).begin()
    assert sorted(path.parent.name for path in orphans if not path.exists()) == ["exports", "uploads"]
