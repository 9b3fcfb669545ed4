"""Objects in a bucket: lists longer than a page, and removals that S3 refuses one by one."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from obstore.exceptions import PermissionDeniedError

from bentray_service.errors import StorageUnavailable
from bentray_service.files import bucket as module
from bentray_service.files.bucket import Bucket


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
