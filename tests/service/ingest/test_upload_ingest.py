"""Ingestion of chunked uploads: in order, on a full disk, and after errors."""

import threading

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.access.quota import Quota
from bentray_service.errors import StorageFull, UnknownId
from bentray_service.files.data_folder import Files
from bentray_service.ingest import upload_ingest as reading
from bentray_service.ingest.fair_queue import FairQueue
from bentray_service.ingest.upload_ingest import UploadIngest
from bentray_service.rows.accounts import Accounts
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL, Tenant
from bentray_service.rows.uploads import Uploads
from bentray_service.settings import ServiceSettings

from ...waiting import wait_until

PATIENCE_S = 60.0


class Store(dict):
    """In place of the rows of datasets."""

    def add(self, tenant, name, *, size, sha256, summary):
        self[name] = size, sha256, summary
        return {}

    def get(self, tenant, name):
        if name not in self:
            raise UnknownId("dataset", name)
        return {}


@pytest.fixture
def bench(tmp_path, monkeypatch):
    """Uploads, a reader of them, and ``answers``: what it meets, one after the other."""
    monkeypatch.setattr(UploadIngest, "idle_s", 0.02)
    monkeypatch.setattr(reading, "PATIENCE_SECONDS", 0.02)
    database = open_database(f"sqlite:///{tmp_path / 'b.sqlite'}")
    made = Bench(database, tmp_path / "data")
    monkeypatch.setattr(reading, "make_canonical", made.meet)
    yield made
    made.reader.stop()
    made.queue.stop()
    database.close()


class Bench:
    def __init__(self, database, folder):
        self.uploads, self.files, self.store = Uploads(database), Files(folder), Store()
        self.files.prepare()
        self.answers, self.read = [], []
        accounts = Accounts(database)
        settings, self.queue = ServiceSettings(data_dir=folder), FairQueue(1, accounts)
        self.queue.start()
        quota = Quota(database, 10**6)
        self.reader = UploadIngest(settings, database, self.files, self.queue, accounts, quota)
        self.reader._stores["dataset"] = self.store

    def meet(self, what, source, result_id, files, limits, given, reserve, started):
        self.read.append(result_id)
        answer = self.answers.pop(0) if self.answers else {"title": "a scan"}
        if isinstance(answer, Exception):
            raise answer
        return answer

    def whole(self, tenant=LOCAL):
        row = self.uploads.add(tenant, "dataset", 3, {}, "", 60.0, 10**6)
        self.files.of(tenant).upload(row.id).write_bytes(b"abc")
        self.uploads.change(row.id, state="reading")
        return row

    def settled(self, row):
        def ended():
            found = self.uploads.get(Tenant(row.tenant), row.id)
            return found.state in ("done", "refused") and found

        return wait_until(ended)


def test_the_oldest_is_read_first(bench):
    rows = [bench.whole() for _ in range(3)]
    bench.reader.start()
    assert [bench.settled(row).state for row in rows] == ["done"] * 3
    assert bench.read == [row.result_id for row in rows]
    assert bench.store[rows[0].result_id][0] == 3
    assert not list(bench.files.root.glob("tenants/*/uploads/*"))


def test_a_full_disk_is_waited_for(bench):
    row = bench.whole()
    bench.answers = [StorageFull("body", "no space", "some")] * 3
    bench.reader.start()
    assert bench.settled(row).state == "done"
    assert bench.read == [row.result_id] * 4


def test_rejections_and_errors_do_not_stop_the_queue(bench):
    bad, odd, good = (bench.whole() for _ in range(3))
    bench.answers = [InvalidInput("file", "nothing", "a scan"), RuntimeError("odd")]
    bench.reader.start()
    assert bench.settled(good).state == "done"
    bad, odd = bench.settled(bad), bench.settled(odd)
    assert (bad.state, bad.problem["field"]) == ("refused", "file")
    assert (odd.state, odd.problem["status"]) == ("refused", 500)
    assert odd.problem["correlation_id"] in odd.problem["detail"]
    assert not list(bench.files.root.glob("tenants/*/uploads/*"))
    assert bench.reader.alive()


def test_uploads_of_other_services_are_ignored(bench):
    row, here = bench.whole(), bench.whole()
    bench.files.of(LOCAL).upload(row.id).unlink()
    bench.reader.start()
    bench.settled(here)
    assert bench.uploads.get(LOCAL, row.id).state == "reading"


def test_terminated_reader_rejects_no_upload(bench, monkeypatch):
    row, begun = bench.whole(), threading.Event()

    def killed(*given):
        begun.set()
        bench.reader._leaving.wait(PATIENCE_S)
        raise InvalidInput("file", "a file that crashed its reader (SIGKILL)", "a scan")

    monkeypatch.setattr(reading, "make_canonical", killed)
    bench.reader.start()
    assert begun.wait(PATIENCE_S)
    bench.reader.stop()
    assert bench.uploads.get(LOCAL, row.id).state == "reading"
    assert bench.files.of(LOCAL).upload(row.id).exists()
