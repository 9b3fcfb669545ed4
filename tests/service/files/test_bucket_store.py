"""A bucket as the store: its objects, opened for one database, and what happens when it is away or bad."""

import os
import secrets
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import pytest
from obstore.exceptions import PermissionDeniedError

from bentray_kernels.errors import InvalidInput
from bentray_service.errors import StorageUnavailable
from bentray_service.files import bucket as bucket_module
from bentray_service.files import bucket as module
from bentray_service.files import bucket_store
from bentray_service.files.bucket import Bucket
from bentray_service.files.bucket_store import FORGOTTEN_S, LEFT_S, MARK, RECENT_S, BucketStore, open_store
from bentray_service.files.data_folder import Files
from bentray_service.files.store import Store
from bentray_service.rows.database import open_database
from bentray_service.rows.ids import LOCAL, new_id

from ... import s3
from .store_suite import StoreSuite

AGES_AGO = time.time() - 10 * RECENT_S


class Nothing:
    """In place of a database: tells what it is told to."""

    def __init__(self):
        self.known, self.needs = set(), set()

    def names(self):
        return self.known

    def needed(self):
        return self.needs


class TestBucketStore(StoreSuite):
    @pytest.fixture
    def bucket(self, bucket_url):
        bucket = Bucket(bucket_url)
        bucket.put_metadata(MARK, {"database": "mine"})
        return bucket

    @pytest.fixture
    def known(self):
        return Nothing()

    @pytest.fixture
    def opened(self, tmp_path, bucket, known):
        def go(folder, cache_bytes=10**9):
            Files(tmp_path / folder).prepare()
            return Files(
                tmp_path / folder, BucketStore(tmp_path / folder, bucket, "mine", known, cache_bytes)
            )

        return go

    @pytest.fixture
    def files(self, opened):
        return opened("one")

    @pytest.fixture
    def elsewhere(self, opened):
        return opened("two")

    def forget(self, *paths):
        """Empty the cache."""
        for path in paths:
            path.unlink()

    def test_publish_and_fetch_leave_no_other_files(self, files, elsewhere):
        path = self.folder(files)
        elsewhere.store.fetch(self.there(elsewhere, path))
        for one in (files, elsewhere):
            assert not list(one.scratch.iterdir())

    def test_simultaneous_requests_share_one_transfer(self, files, s3_server):
        path = self.file(files, secrets.token_bytes(100_000))
        content = path.read_bytes()
        self.forget(path)
        s3_server.asked.clear()
        barrier = threading.Barrier(8)

        def ask(_):
            barrier.wait()
            return files.store.fetch(path).read_bytes()

        with ThreadPoolExecutor(8) as pool:
            assert set(pool.map(ask, range(8))) == {content}
        assert len([path for method, path in s3_server.asked if method == "GET"]) == 1

    def test_a_large_file_goes_and_comes_in_parts(self, files, monkeypatch, s3_server):
        monkeypatch.setattr(bucket_module, "PART_BYTES", 5 * 2**20)
        content = secrets.token_bytes(12 * 2**20)
        s3_server.asked.clear()
        path = self.file(files, content)
        # It is begun, then come the parts, then it is put together.
        assert [method for method, _ in s3_server.asked].count("PUT") == 3
        self.forget(path)
        assert files.store.fetch(path).read_bytes() == content

    def test_unavailable_bucket_loses_no_object(self, files, s3_server, caplog):
        there, gone = self.file(files), self.file(files)
        self.forget(gone)
        new = files.of(LOCAL).dataset(new_id("dataset"))
        new.write_bytes(b"new")
        s3_server.away.set()
        for ask in (
            lambda: files.store.publish(new),
            lambda: files.store.fetch(gone),
            lambda: files.store.remove([there]),
            lambda: files.store.tidy(lambda: False),
        ):
            with pytest.raises(StorageUnavailable):
                ask()
        assert "bucket" in files.store.fault()
        assert files.store.fetch(there).read_bytes() == b"abc"
        assert s3.SECRET not in caplog.text
        s3_server.away.clear()
        assert files.store.fault() is None
        files.store.publish(new)
        assert files.store.fetch(gone).read_bytes() == b"abc"
        assert not list(files.scratch.iterdir())

    def test_an_upload_that_cannot_be_kept_leaves_nothing(self, files, s3_server):
        mine, name = files.of(LOCAL), new_id("dataset")
        mine.candidate(name).write_bytes(b"checked")
        s3_server.away.set()
        with pytest.raises(StorageUnavailable):
            mine.adopt(name)
        assert not mine.dataset(name).exists()

    def test_damaged_objects_are_not_fetched(self, files, bucket):
        path = self.file(files)
        key = path.relative_to(files.root).as_posix()
        told = bucket.metadata(key)
        self.forget(path)
        (files.scratch / "damaged").write_bytes(b"abd")
        bucket.put(files.scratch / "damaged", key, {name: told[name] for name in told if name != "size"})
        with pytest.raises(OSError, match="SHA-256"):
            files.store.fetch(path)
        assert not path.exists()

    def test_least_recently_used_files_are_evicted(self, opened, known):
        files = opened("small", cache_bytes=250)
        oldest, needed, older, newer = (self.file(files, bytes(100)) for _ in range(4))
        export = files.of(LOCAL).export("vol-" + "0" * 20, "npy")
        export.write_bytes(bytes(10))
        unpublished = files.of(LOCAL).dataset(new_id("dataset"))
        unpublished.write_bytes(bytes(5))
        for age, path in enumerate([newer, older, needed, oldest, export, unpublished]):
            os.utime(path, (AGES_AGO - age, AGES_AGO))
        known.needs = {needed.stem}
        recent = self.file(files, bytes(45))
        assert {
            path for path in (oldest, needed, older, newer, export, unpublished, recent) if path.exists()
        } == {
            needed,
            newer,
            unpublished,
            recent,
        }
        # What went comes back when somebody asks for it, and what is in use may be more than was allowed.
        assert all(files.store.fetch(path).exists() for path in (oldest, older, newer))

    def test_orphans_are_removed_and_local_files_published(
        self, files, elsewhere, known, bucket, monkeypatch
    ):
        kept, orphan, forgotten = self.file(files), self.file(files), self.file(files)
        alone = files.of(LOCAL).volume(new_id("volume"))
        alone.write_bytes(b"from before there was a bucket")
        self.forget(orphan)
        known.known = {(LOCAL, kept.stem), (LOCAL, alone.stem)}
        # Young as they are, they may be about to have rows.
        files.store.tidy(lambda: False)
        assert files.store.fetch(orphan).exists()
        assert forgotten.exists()
        later = time.time() + max(FORGOTTEN_S, LEFT_S) + 60.0
        monkeypatch.setattr(bucket_store, "time", SimpleNamespace(**vars(time) | {"time": lambda: later}))
        files.store.tidy(lambda: False)
        left = {one["path"].rpartition("/")[2] for one in bucket.listed("tenants/")}
        assert left == {kept.name, alone.name}
        assert not forgotten.exists()
        assert not orphan.exists()
        assert elsewhere.store.fetch(self.there(elsewhere, alone)).read_bytes() == alone.read_bytes()

    def test_bucket_without_marker_is_an_error(self, files, bucket):
        path = self.file(files)
        self.forget(path)
        bucket.remove([MARK, path.relative_to(files.root).as_posix()])
        assert "belongs to another database" in files.store.fault()
        with pytest.raises(StorageUnavailable):
            files.store.fetch(path)


@pytest.fixture
def databases(tmp_path):
    opened = [open_database(f"sqlite:///{tmp_path / name}") for name in ("a.sqlite", "b.sqlite")]
    yield opened
    for one in opened:
        one.close()


def test_without_an_address_it_is_the_data_folder(databases, tmp_path):
    assert type(open_store(None, tmp_path, databases[0], 0)) is Store


def test_a_bucket_belongs_to_one_database(databases, tmp_path, bucket_url):
    mine, other = databases
    for _ in range(2):
        assert isinstance(open_store(bucket_url, tmp_path, mine, 0), BucketStore)
    with pytest.raises(InvalidInput, match="another database"):
        open_store(bucket_url, tmp_path, other, 0)
    assert open_store(f"{bucket_url}/other", tmp_path, other, 0).fault() is None


def test_prefix_in_use_is_rejected(databases, tmp_path, bucket_url):
    Bucket(bucket_url).put_metadata("photographs/1.jpg", {})
    with pytest.raises(InvalidInput, match="which contains other objects"):
        open_store(bucket_url, tmp_path, databases[0], 0)


def test_rejects_missing_or_unresponsive_buckets(databases, tmp_path, bucket_url, s3_server):
    with pytest.raises(InvalidInput, match="BENTRAY_STORAGE_URL"):
        open_store("s3://nobody-made-this-one", tmp_path, databases[0], 0)
    s3_server.away.set()
    with pytest.raises(InvalidInput, match="error of the bucket"):
        open_store(bucket_url, tmp_path, databases[0], 0)


def test_lists_and_removals_go_beyond_a_page(bucket_url):
    bucket = Bucket(bucket_url)
    names = [f"a/{number:04d}" for number in range(1003)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda name: bucket.put_metadata(name, {}), [*names, "b"]))
    assert sorted(item["path"] for item in bucket.listed("a/")) == names
    bucket.remove([*names, "c"])
    assert [item["path"] for item in bucket.listed()] == ["b"]


def test_two_prefixes_of_a_bucket_do_not_meet(bucket_url):
    first, two = Bucket(bucket_url), Bucket(f"{bucket_url}-2/")
    first.put_metadata("a", {"of": "one"})
    two.put_metadata("a", {"of": "two"})
    assert (first.metadata("a")["of"], two.metadata("a")["of"]) == ("one", "two")
    assert [held["path"] for held in first.listed()] == ["a"]


def test_a_removal_that_is_rejected_is_no_removal(bucket_url, monkeypatch):
    bucket = Bucket(bucket_url)

    def refuse(*_):
        raise PermissionDeniedError("AccessDenied")

    monkeypatch.setattr(module.obstore, "delete", refuse)
    with pytest.raises(StorageUnavailable):
        bucket.remove(["a"])


@pytest.mark.parametrize(
    "ask", [lambda it: list(it.listed()), lambda it: it.put_metadata("a", {}), lambda it: it.remove("a")]
)
def test_missing_bucket_is_not_a_missing_object(bucket_url, ask):
    with pytest.raises(StorageUnavailable):
        ask(Bucket(f"{bucket_url.removesuffix('/scans')}-missing"))


def test_unresponsive_bucket_times_out(bucket_url, s3_server, monkeypatch):
    monkeypatch.setattr(module, "ANSWER_S", 0.5)
    bucket = Bucket(bucket_url)
    s3_server.silent.set()
    try:
        with pytest.raises(StorageUnavailable):
            bucket.metadata("a")
    finally:
        s3_server.silent.clear()
    assert bucket.metadata("a") is None


def test_credentials_come_from_a_file_too(bucket_url, monkeypatch, tmp_path):
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    secret = tmp_path / "credentials"
    secret.write_text(
        "[default]\naws_access_key_id = wrong\n[lab]\naws_access_key_id = named\naws_secret_access_key = s\n"
    )
    monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", str(secret))
    monkeypatch.setenv("AWS_PROFILE", "lab")
    bucket = Bucket(bucket_url)
    bucket.put_metadata("a", {})
    assert "named" in bucket.put_url("a", 60)
