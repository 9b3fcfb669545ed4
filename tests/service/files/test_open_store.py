"""Opening a store: a bucket belongs to one database, and has to answer."""

import pytest

from bentray_kernels.errors import InvalidInput
from bentray_service.files.bucket import Bucket
from bentray_service.files.bucket_store import BucketStore, open_store
from bentray_service.files.store import Store
from bentray_service.rows.database import open_database


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
