"""Objects under one prefix of a bucket by obstore; errors become ``StorageUnavailable``."""

from __future__ import annotations

import configparser
import errno
import logging
import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any

import obstore
from obstore.exceptions import BaseError, NotFoundError
from obstore.store import ObjectStore, from_url

from ..errors import StorageUnavailable

log = logging.getLogger("bentray.storage")

# Size of the parts of an upload or download, larger for files with more than MAX_PARTS parts.
PART_BYTES = 16 * 2**20
PARTS_AT_ONCE = 4
MAX_PARTS = 10_000
# Time for one part, and for any other answer, s. An unreachable bucket is given up after about ten seconds.
TRANSFER_S = 120.0
ANSWER_S = 10.0
CONNECT_S = 3.0
RETRIES = 2

# Settings in the files of AWS: name of the variable that takes precedence.
AWS_SETTINGS = {
    "aws_access_key_id": "AWS_ACCESS_KEY_ID",
    "aws_secret_access_key": "AWS_SECRET_ACCESS_KEY",
    "aws_session_token": "AWS_SESSION_TOKEN",
    "region": "AWS_DEFAULT_REGION",
    "endpoint_url": "AWS_ENDPOINT_URL",
}


class Bucket:
    """A bucket; keys are relative to the prefix.

    Credentials come from the variables of its provider; those of S3 also from the files of AWS
    (``AWS_SHARED_CREDENTIALS_FILE``, ``AWS_CONFIG_FILE``, ``AWS_PROFILE``), or from the machine's role.
    """

    def __init__(self, url: str, public_endpoint: str | None = None) -> None:
        """Args:
        url: ``s3://``, ``gs://`` or ``az://``, then ``bucket`` or ``bucket/prefix``.
        public_endpoint: address of an S3 server for clients, by which ``put_url`` signs; None: that of the
            service.

        Raises:
            StorageUnavailable: for an address or credentials that make no client.
        """
        self.url = url.rstrip("/")
        with self._watched():
            credentials = _aws_files() if self.url.startswith("s3:") else {}
            self._store = _client(self.url, ANSWER_S, **credentials)
            self._transfers = _client(self.url, TRANSFER_S, **credentials)
            # The host is signed, too, so that addresses cannot be rewritten afterwards.
            if public_endpoint is not None:
                credentials["endpoint_url"] = public_endpoint
            self._signing: Any = _client(self.url, ANSWER_S, **credentials)

    def put(self, path: Path, key: str, metadata: Mapping[str, str]) -> None:
        """Upload a file with metadata; the object is complete or absent."""
        chunk_bytes = max(PART_BYTES, -(-path.stat().st_size // MAX_PARTS))
        attributes = dict(metadata)
        with self._watched():
            obstore.put(
                self._transfers,
                key,
                path,
                attributes=attributes,
                chunk_size=chunk_bytes,
                max_concurrency=PARTS_AT_ONCE,
            )

    def get(self, key: str, path: Path, mode: str = "wb") -> None:
        """Download an object; after an error the file may be incomplete.

        Args:
            key: of the object.
            path: file to write.
            mode: ``ab`` to append.

        Raises:
            FileNotFoundError: when the object does not exist.
        """
        with self._watched(may_miss=True), path.open(mode) as file:
            size = obstore.head(self._store, key)["size"]
            for start in range(0, size, PART_BYTES):
                end = min(size, start + PART_BYTES)
                file.write(obstore.get_range(self._transfers, key, start=start, end=end))

    def put_metadata(self, key: str, metadata: Mapping[str, str]) -> None:
        """Write an empty object with metadata."""
        with self._watched():
            obstore.put(self._store, key, b"", attributes=dict(metadata))

    def metadata(self, key: str) -> dict[str, str] | None:
        """Metadata of an object, with its ``size``; None if it does not exist."""
        try:
            with self._watched(may_miss=True):
                head = obstore.get(self._store, key, options={"head": True})
        except FileNotFoundError:
            return None
        return {**{str(name): text for name, text in head.attributes.items()}, "size": str(head.meta["size"])}

    def listed(self, under: str = "") -> Iterator[obstore.ObjectMeta]:
        """All objects in the folder ``under``, or in the whole bucket; ``path`` is the key."""
        pages = iter(obstore.list(self._store, prefix=under or None))
        while True:
            with self._watched():
                page = next(pages, None)
            if page is None:
                return
            yield from page

    def remove(self, keys: Collection[str]) -> None:
        """Delete objects; missing ones are ignored."""
        try:
            with self._watched(may_miss=True):
                obstore.delete(self._store, list(keys))
        except FileNotFoundError:
            # Google and Azure stop at the first missing object.
            if len(keys) > 1:
                for key in keys:
                    self.remove([key])

    def put_url(self, key: str, seconds: int) -> str:
        """Address for a PUT of an object by others, valid for some seconds."""
        with self._watched():
            return str(obstore.sign(self._signing, "PUT", key, timedelta(seconds=seconds)))

    @contextmanager
    def _watched(self, *, may_miss: bool = False) -> Iterator[None]:
        """Turn errors into ``StorageUnavailable``; with ``may_miss`` not a missing object."""
        try:
            yield
        except (BaseError, OSError, ValueError) as error:
            missing = isinstance(error, NotFoundError | FileNotFoundError)
            if may_miss and missing and "NoSuchBucket" not in str(error):
                raise FileNotFoundError(errno.ENOENT, "not in the bucket") from error
            if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
                raise
            # Callers must not see the address and the key.
            log.warning("%s: %s: %s", self.url, type(error).__name__, str(error).partition("\n")[0])
            raise StorageUnavailable(f"error of the bucket ({type(error).__name__})") from error


def _aws_files() -> dict[str, str]:
    """Settings of the profile in the files of AWS, without those that a variable states."""
    profile = os.environ.get("AWS_PROFILE", "default")
    settings: dict[str, str] = {}
    for name, file in (("AWS_SHARED_CREDENTIALS_FILE", "credentials"), ("AWS_CONFIG_FILE", "config")):
        parser = configparser.RawConfigParser()
        # Without a home the path does not exist.
        parser.read(os.environ.get(name) or os.path.expanduser(f"~/.aws/{file}"))  # noqa: PTH111
        for section in (profile, f"profile {profile}"):
            settings |= dict(parser[section]) if parser.has_section(section) else {}
    stated = {name for name, variable in AWS_SETTINGS.items() if variable in os.environ}
    return {name: settings[name] for name in AWS_SETTINGS.keys() & settings.keys() - stated}


def _client(url: str, seconds: float, **more: str) -> ObjectStore:
    # Which settings there are depends on the provider in the address.
    made: Any = from_url
    store: ObjectStore = made(
        url,
        client_options={
            "allow_http": True,
            "connect_timeout": timedelta(seconds=CONNECT_S),
            "timeout": timedelta(seconds=seconds),
        },
        retry_config={"max_retries": RETRIES, "retry_timeout": timedelta(seconds=ANSWER_S)},
        **more,
    )
    return store
