"""A service that lost its database, or its keys, does not start as a new one that is open to everybody."""

import shutil
import sqlite3
from contextlib import closing, suppress

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.app import create_app
from bentray_service.files.data_folder import GUARDED, STAMP, Files, open_folder_database
from bentray_service.rows.ids import LOCAL
from bentray_service.rows.keys import ApiKey, Keys
from bentray_service.settings import ServiceSettings

from ..conftest import TestClient

FILE = "bentray.sqlite"
# What a start leaves that ends early.
OWN = ("service.lock", f"{FILE}-")


def of_another_program(path):
    path.unlink()
    with closing(sqlite3.connect(path)) as other, other:
        other.execute("CREATE TABLE patients (name TEXT)")


def of_another_program_about_itself(path):
    path.unlink()
    with closing(sqlite3.connect(path)) as other, other:
        other.execute("CREATE TABLE about (name TEXT)")


def of_another_folder(path):
    remove(path)
    elsewhere = Files(path.parent.parent / "elsewhere")
    elsewhere.prepare()
    open_folder_database(elsewhere, f"sqlite:///{elsewhere.root / FILE}").close()
    shutil.copy(elsewhere.root / FILE, path)


def remove(path):
    for found in path.parent.glob(f"{FILE}*"):
        found.unlink()


def of_version(version):
    def change(path):
        with closing(sqlite3.connect(path)) as database, database:
            database.execute(f"UPDATE alembic_version SET version_num = {version}")

    return change


def cut(share):
    return lambda path: path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])


LOST = {
    "missing": (remove, "missing"),
    "empty": (lambda path: path.write_bytes(b""), "without content"),
    "a folder": (lambda path: (remove(path), path.mkdir()), "without content"),
    "of zeros": (lambda path: path.write_bytes(bytes(8192)), "not a database"),
    "no database": (lambda path: path.write_bytes(b"certainly not a database, " * 400), "not a database"),
    "a byte": (lambda path: path.write_bytes(b"S"), "without tables"),
    "half": (cut(0.5), "malformed"),
    "all but the last page": (lambda path: path.write_bytes(path.read_bytes()[:-4096]), "malformed"),
    "without tables": (
        lambda path: (remove(path), sqlite3.connect(path).execute("VACUUM")),
        "without tables",
    ),
    "of another program": (of_another_program, "of another program \\(patients\\)"),
    "of another program about itself": (of_another_program_about_itself, "about.version"),
    "of another folder": (of_another_folder, "the database of another data folder"),
    "of a later version": (of_version(99), "schema version 99"),
    "of no version": (of_version(0), "schema version 0"),
}


@pytest.fixture
def folder(tmp_path):
    """The data folder of a service that had a key, and has ended."""
    files = Files(tmp_path / "data")
    files.prepare()
    with closing(opened(files)) as database:
        Keys(database).add(ApiKey.new(), LOCAL, "one", ("read",))
    return files


def opened(files):
    return open_folder_database(files, f"sqlite:///{files.root / FILE}")


def contents(root):
    """The files of a folder; of a database that can be read its rows, since its header may change."""
    found = {}
    for path in root.rglob("*"):
        if path.is_file() and not path.name.startswith(OWN):
            found[path] = path.read_bytes()
            if path.name == FILE and path.stat().st_size:
                with closing(sqlite3.connect(path)) as database, suppress(sqlite3.DatabaseError):
                    found[path] = list(database.iterdump())
    return found


@pytest.mark.parametrize("name", LOST)
def test_a_lost_database_is_not_replaced_by_a_new_one(start, folder, name):
    opened(folder).close()
    lose, found = LOST[name]
    lose(folder.root / FILE)
    before = contents(folder.root)
    with pytest.raises(InvalidInput, match=f"^database_url: .*{found}") as refused:
        start()
    # Also for the commands, which would make a new one.
    with pytest.raises(InvalidInput, match=r"^database_url:"):
        opened(folder)
    assert contents(folder.root) == before
    if "schema" not in found:
        assert "bentray restore" in str(refused.value)
        assert "new data folder" in str(refused.value)


@pytest.mark.parametrize(
    "kept", ["tenants/clinic/datasets/ds-1.h5", "audit/2026-11-27.jsonl", GUARDED, STAMP]
)
def test_any_trace_of_a_service_is_enough(tmp_path, kept):
    files = Files(tmp_path / "data")
    files.prepare()
    (files.root / kept).parent.mkdir(parents=True, exist_ok=True)
    (files.root / kept).write_bytes(b"")
    with pytest.raises(InvalidInput, match="missing"):
        opened(files)
    assert not (files.root / FILE).exists()


def test_a_new_folder_gets_a_database_and_keeps_it(tmp_path, folder):
    for _ in range(2):
        with closing(opened(folder)) as database:
            assert Keys(database).any()
    # One whose record was lost is taken up again.
    (folder.root / STAMP).unlink()
    opened(folder).close()


def test_an_empty_postgresql_beside_files_is_refused(folder, postgresql_server):
    address = postgresql_server.new_database()
    with pytest.raises(InvalidInput, match=r"database_url: .*without tables.*bentray restore"):
        open_folder_database(folder, address)
    (fresh := Files(folder.root.parent / "fresh")).prepare()
    open_folder_database(fresh, address).close()
    with pytest.raises(InvalidInput, match="the database of another data folder"):
        open_folder_database(folder, address)
    postgresql_server.drop(address)


@pytest.fixture
def status(tmp_path, cluster):
    """Start a service, ask for the datasets without a key, and stop it; returns the status."""

    def ask(**settings):
        app = create_app(ServiceSettings(data_dir=tmp_path / "data", **settings), cluster)
        with TestClient(app, base_url="http://localhost") as http:
            return http.get("/v1/datasets").status_code

    return ask


def test_lost_settings_do_not_open_a_service(status, tmp_path):
    assert status(trusted_proxies="192.0.2.7") == 401
    with pytest.raises(InvalidInput, match=f"^authentication: .*delete .*{GUARDED}"):
        status()
    assert status(trusted_proxies="192.0.2.7") == 401
    # As the message says.
    (tmp_path / "data" / GUARDED).unlink()
    assert status() == 200


def test_a_database_of_before_its_keys_does_not_open_a_service(status, tmp_path):
    files = Files(tmp_path / "data")
    assert status() == 200
    shutil.copy(files.root / FILE, tmp_path / "before")
    with closing(opened(files)) as database:
        key = Keys(database).add(ApiKey.new(), LOCAL, "one", ("read",))
    assert status() == 401
    with closing(opened(files)) as database:
        Keys(database).revoke(key.id)
    # The operator may revoke all keys: nobody comes in then.
    assert status() == 401
    remove(files.root / FILE)
    shutil.copy(tmp_path / "before", files.root / FILE)
    with pytest.raises(InvalidInput, match=r"^authentication: .*bentray keys create"):
        status()
    with closing(opened(files)) as database:
        Keys(database).add(ApiKey.new(), LOCAL, "one", ("read",))
    assert status() == 401
