"""Buckets and databases, as for the tests of files."""

from ..cli.conftest import bentray
from ..files.conftest import bucket_url, postgresql_database, s3_server

__all__ = ["bentray", "bucket_url", "postgresql_database", "s3_server"]
